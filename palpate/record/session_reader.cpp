// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/session_reader.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "palpate/io/bag/messages.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr double most = 9007199254740992.0;  // 2^53

std::uint64_t whole(double value, const std::string& name) {
  if (!(value >= 0.0 && value <= most && value == std::floor(value)))
    throw Error(name, "has a number of " + std::to_string(value), "it may be damaged");
  return static_cast<std::uint64_t>(value);
}

}  // namespace

template <class Message, class Take>
void SessionReader::read_all(std::string_view topic, const Take& take) {
  for (const BagReader::Place& place : bag_.places(topic)) {
    const std::string name = bag_.name(topic, place);
    take(ros::decode<Message>(bag_.read(place), name), name);
  }
}

// The recording of the first hand, in whose folder that of another one lies.
std::unique_ptr<SessionReader> SessionReader::parent_of(const std::filesystem::path& path) {
  const auto folder = [](std::filesystem::path of) {
    if (!of.has_filename()) of = of.parent_path();  // a slash at its end
    return of.parent_path();
  };
  std::error_code unused;
  const std::filesystem::path here = std::filesystem::absolute(path).lexically_normal();
  const std::filesystem::path first =
      folder(std::filesystem::is_regular_file(here, unused) ? folder(here) : here);
  try {
    auto parent = std::make_unique<SessionReader>(first);
    if (!parent->info_.frames_in_parent) return parent;
  } catch (const Error& error) {
    throw Error(path.string(),
                std::string("needs the recording of the first hand: ") + error.what(),
                "leave it in the folder in which it was made");
  }
  throw Error(path.string(), "lies in a recording that has no frames either",
              "leave it in the folder in which it was made");
}

SessionReader::SessionReader(const std::filesystem::path& path) : bag_(path) {
  const BagReader::Topic* session = bag_.find(session_topic::session);
  if (session == nullptr || bag_.places(session_topic::session).empty())
    throw Error(path.string(), "is not a session of palpate's",
                "its frames may still be touched, with --camera recording:" + path.string());
  read_all<ros::String>(session_topic::session, [&](const auto& message, const auto& name) {
    info_ = session_from_json(message.data, name);
  });
  rows_ = TickRows(info_.tick_columns);
  if (info_.frames_in_parent) parent_ = parent_of(path);
  read_all<ros::String>(session_topic::settings, [&](const auto& message, const auto& name) {
    ServoCommands commands = commands_from_json(message.data, name);
    commands_[commands.number] = std::move(commands);
  });
  read_frames();
  read_all<ros::Float64MultiArray>(session_topic::adopted,
                                   [&](const auto& message, const auto& name) {
                                     const AdoptedFrame frame = adopted_of(message.data, name);
                                     if (!adopted_.contains(frame.number) && frame.tick)
                                       taken_[*frame.tick].push_back(frame.number);
                                     adopted_[frame.number] = frame;
                                   });
  read_all<ros::Float64MultiArray>(
      session_topic::state, [&](const auto& message, const auto& /*name*/) {
        std::string names;
        for (const std::string& each : cycle_state_names())
          names += (names.empty() ? "" : ",") + each;
        const std::vector<double>& row = message.data;
        if (message.label != names || row.size() > CycleState::capacity) return;
        state_.emplace().count = row.size();
        std::copy(row.begin(), row.end(), state_->numbers.begin());
      });
  ticks_ = bag_.places(session_topic::tick);
}

void SessionReader::read_frames() {
  std::map<std::size_t, std::size_t> newest;  // image of each camera
  read_all<ros::Float64MultiArray>(
      session_topic::frame, [&](const auto& message, const auto& name) {
        const std::vector<double>& row = message.data;
        if (row.size() < 2 || row.size() % 2 != 0)
          throw Error(name, "has " + std::to_string(row.size()) + " numbers", "it may be damaged");
        PutFrame& frame = frames_[whole(row[0], name)];
        frame.stamp = row[1];
        for (std::size_t i = 2; i < row.size(); i += 2)
          frame.images.emplace_back(whole(row[i], name), whole(row[i + 1], name));
        // An old recording names what all cameras saw last; what has changed was new.
        if (frame.images.size() > 1) {
          std::vector<std::pair<std::size_t, std::size_t>> fresh;
          for (const auto& image : frame.images) {
            const auto known = newest.find(image.first);
            if (known == newest.end() || known->second != image.second) fresh.push_back(image);
          }
          if (!fresh.empty()) frame.images = std::move(fresh);
        }
        for (const auto& [camera, image] : frame.images) newest[camera] = image;
      });
}

ServoTick SessionReader::tick(std::size_t index) {
  const BagReader::Place& place = ticks_.at(index);
  const std::string name = bag_.name(session_topic::tick, place);
  return rows_.read(ros::decode<ros::Float64MultiArray>(bag_.read(place), name).data, name);
}

const ServoCommands& SessionReader::commands(std::uint64_t number) const {
  const auto found = commands_.find(number);
  if (found == commands_.end())
    throw Error("recording", "has no settings " + std::to_string(number), "it may be damaged");
  return found->second;
}

std::shared_ptr<const Cloud> SessionReader::cloud(std::size_t camera, std::size_t number) {
  Camera& entry = cameras_[camera];
  if (entry.cloud && entry.number == number) return entry.cloud;
  if (!entry.camera) {
    const CameraTopics topics(camera);
    entry.camera.emplace(bag_, bag_.find(topics.depth) != nullptr ? topics.depth : topics.points,
                         BagCamera::Options{});
  }
  if (number >= entry.camera->frames())
    throw Error("recording",
                "has no frame " + std::to_string(number) + " on " + entry.camera->topic(),
                "it may be damaged");
  entry.cloud = entry.camera->frame(number).value().cloud;
  entry.number = number;
  return entry.cloud;
}

std::vector<std::uint64_t> SessionReader::taken_in(const ServoTick& tick,
                                                   std::uint64_t before) const {
  if (const auto taken = taken_.find(tick.number); taken != taken_.end()) return taken->second;
  if (!taken_.empty() || tick.frame_number == before) return {};
  return {tick.frame_number};
}

std::vector<FrameInUse> SessionReader::seen(std::uint64_t number) {
  if (parent_) return parent_->seen(number);
  const auto found = frames_.find(number);
  if (found == frames_.end())
    throw Error("recording", "lacks frame " + std::to_string(number),
                "the disk was too slow, or the recording is damaged");
  const PutFrame& frame = found->second;
  if (frame.images.empty())
    throw Error("recording", "a frame was dropped during recording",
                "the computer or its disk was too slow to record all frames");
  std::vector<FrameInUse> all;
  for (const auto& [camera, image] : frame.images) {
    if (camera >= Freshness::max_cameras)
      throw Error("recording", "has a camera " + std::to_string(camera), "it may be damaged");
    all.push_back({.cloud = cloud(camera, image), .stamp = frame.stamp, .camera = camera});
  }
  return all;
}

}  // namespace palpate
