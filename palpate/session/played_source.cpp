// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/played_source.hpp"

#include <utility>

#include "palpate/core/error.hpp"

namespace palpate {

PlayedSource::PlayedSource(std::unique_ptr<Source> source,
                           std::function<std::unique_ptr<Source>()> open)
    : source_(std::move(source)), open_(std::move(open)) {
  const SourceInfo& info = source_->info();
  if (info.live)
    throw Error(info.uri, "a live camera cannot be played faster than it captures",
                "run the session in real time");
  status_.uri = info.uri;
  status_.kind = info.kind;
  status_.rate = info.frame_rate.value_or(0.0);
  status_.state = CameraState::live;
  status_.text = "live";
}

void PlayedSource::begin() {
  if (next_ || frames_in_pass_ > 0) return;
  next_ = source_->next();
  if (!next_) throw Error(status_.uri, "it has no frames", "give a source with at least one");
  offset_ = -next_->stamp;
}

const Frame& PlayedSource::first_frame() {
  begin();
  return *next_;
}

// The frame after the last: of a recording that is over, the first again.
void PlayedSource::read_next() {
  next_ = source_->next();
  if (next_) return;
  if (frames_in_pass_ <= 1) {
    is_still_ = true;
    return;
  }
  source_ = open_();
  frames_in_pass_ = 0;
  next_ = source_->next();
  if (!next_) throw Error(status_.uri, "it has no frames any more", "check the recording");
  offset_ = last_ + interval_ - next_->stamp;
}

std::optional<FedFrame> PlayedSource::next_until(double t) {
  begin();
  if (is_still_) {
    constexpr double still_interval = 1.0 / 30.0;  // [s]
    if (last_ + still_interval > t) return std::nullopt;
    last_ += still_interval;
    Frame frame = still_;
    frame.stamp = last_;
    return FedFrame{.frame = std::move(frame), .source_stamp = still_.stamp, .is_new = false};
  }
  const double stamp = next_->stamp + offset_;
  if (stamp > t) return std::nullopt;
  FedFrame fed{.frame = std::move(*next_), .source_stamp = next_->stamp};
  fed.frame.stamp = stamp;
  if (frames_in_pass_ == 0) {
    still_ = fed.frame;
    still_.stamp = fed.source_stamp;
  } else if (stamp > last_) {
    interval_ = stamp - last_;
  }
  last_ = stamp;
  ++frames_in_pass_;
  ++status_.frames;
  status_.last_frame = stamp;
  if (frames_in_pass_ > 1) still_ = {};
  read_next();
  return fed;
}

}  // namespace palpate
