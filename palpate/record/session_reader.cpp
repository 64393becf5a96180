// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/session_reader.hpp"

#include <algorithm>
#include <string>

#include "palpate/io/bag/messages.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {

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
  read_all<ros::Float64MultiArray>(session_topic::frame,
                                   [&](const auto& message, const auto& name) {
                                     GetNumbers get(message.data, name);
                                     std::uint64_t number = 0;
                                     get("number", number);
                                     PutFrame& frame = frames_[number];
                                     get("stamp", frame.stamp);
                                     if (get.at_end()) return;
                                     auto& [camera, image] = frame.image.emplace();
                                     get("camera", camera);
                                     get("image", image);
                                   });
  read_all<ros::Float64MultiArray>(session_topic::adopted,
                                   [&](const auto& message, const auto& name) {
                                     const AdoptedFrame frame = adopted_of(message.data, name);
                                     if (!adopted_.contains(frame.number))
                                       taken_[frame.tick].push_back(frame.number);
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

std::span<const std::uint64_t> SessionReader::taken_in(const ServoTick& tick) const {
  const auto taken = taken_.find(tick.number);
  return taken == taken_.end() ? std::span<const std::uint64_t>() : taken->second;
}

FrameInUse SessionReader::seen(std::uint64_t number) {
  if (parent_) return parent_->seen(number);
  const auto found = frames_.find(number);
  if (found == frames_.end())
    throw Error("recording", "lacks frame " + std::to_string(number),
                "the disk was too slow, or the recording is damaged");
  const PutFrame& frame = found->second;
  if (!frame.image)
    throw Error("recording", "a frame was dropped during recording",
                "the computer or its disk was too slow to record all frames");
  const auto [camera, image] = *frame.image;
  if (camera >= Freshness::max_cameras)
    throw Error("recording", "has a camera " + std::to_string(camera), "it may be damaged");
  return {.cloud = cloud(camera, image), .stamp = frame.stamp, .camera = camera};
}

std::vector<Tick> recorded_hand(const std::filesystem::path& recording, std::size_t most) {
  SessionReader session(recording);
  std::vector<Tick> path;
  const std::size_t count = session.ticks();
  const std::size_t points = std::min(count, std::max<std::size_t>(most, 2));
  for (std::size_t i = 0; i < points; ++i)
    path.push_back(session.tick(points == 1 ? 0 : i * (count - 1) / (points - 1)).tick);
  return path;
}

}  // namespace palpate
