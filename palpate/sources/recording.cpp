// SPDX-License-Identifier: Apache-2.0
#include "palpate/sources/recording.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/sources/bag_camera.hpp"

namespace palpate {
namespace {

class Recording final : public Source {
 public:
  Recording(const Uri& uri, const BagCamera::Options& options, SourceInfo info)
      : bag_(uri.path()),
        camera_(bag_, choose(uri.text_option("topic", ""), info), options),
        info_(std::move(info)) {
    if (camera_.frames() == 0)
      throw Error(info_.uri, "holds no frames on " + camera_.topic(),
                  "name another topic with ?topic=");
    info_.kind = camera_.is_ours()        ? "recording of palpate's"
                 : camera_.is_realsense() ? "RealSense recording"
                                          : std::string(bag_.kind());
    info_.sensor = sensor_option(uri, camera_.sensor());
    info_.frames = camera_.frames();
    info_.frame_rate = camera_.frame_rate();
    if (std::string note = camera_.pose_note(); !note.empty())
      info_.notes.push_back(std::move(note));
    if (!camera_.colour_note().empty()) info_.notes.push_back(camera_.colour_note());
    std::optional<Frame> first;
    while (!(first = camera_.frame(next_)) && next_ + 1 < camera_.frames()) ++next_;
    if (!first)
      throw Error(info_.uri, "its TF has no transform for the time of any frame",
                  "ignore TF with ?fixed_frame=none");
    first_ = first->stamp;
    info_.start_time = first_;
  }

  std::optional<Frame> next(double /*timeout*/) override {
    while (next_ < camera_.frames()) {
      std::optional<Frame> frame = camera_.frame(next_++);
      if (!frame) continue;
      frame->stamp -= first_;
      info_.details = camera_.details();
      return frame;
    }
    return std::nullopt;
  }

  std::size_t skip(std::size_t count) override {
    const std::size_t skipped = std::min(count, camera_.frames() - next_);
    next_ += skipped;
    return skipped;
  }

  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  std::string choose(const std::string& wanted, SourceInfo& info) const {
    const std::vector<std::string> topics = BagCamera::topics_of(bag_);
    if (!wanted.empty()) return wanted;
    if (topics.empty())
      throw Error(info.uri, "has no topic of depth images or points",
                  "record one, or name it with ?topic=");
    std::string others;
    for (std::size_t i = 1; i < topics.size(); ++i) others += " " + topics[i];
    if (!others.empty())
      info.notes.push_back(topics.front() + " is read; also there, by ?topic=:" + others);
    return topics.front();
  }

  BagReader bag_;
  BagCamera camera_;
  SourceInfo info_;
  double first_ = 0.0;
  std::size_t next_ = 0;
};

}  // namespace

std::unique_ptr<Source> open_recording(const Uri& uri) {
  constexpr std::array<std::string_view, 4> known{"topic", "units", "fixed_frame", "sensor"};
  uri.allow_only(known);
  BagCamera::Options options;
  if (uri.has("units")) options.units = uri.number_option("units", 1000.0, 1e-3, 1e7, "px");
  options.fixed_frame = uri.text_option("fixed_frame", "");
  return std::make_unique<Recording>(uri, options, SourceInfo{.uri = uri.text(), .kind = {}});
}

}  // namespace palpate
