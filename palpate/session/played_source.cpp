// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/played_source.hpp"

#include <cmath>
#include <utility>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr int most_dropped = 100;     // frames in a row that one look leaves out
constexpr double longest_gap = 10.0;  // [s] between frames beyond which it is cut short

}  // namespace

PlayedSource::PlayedSource(std::unique_ptr<Source> source,
                           std::function<std::unique_ptr<Source>()> open)
    : source_(std::move(source)), open_(std::move(open)) {
  const SourceInfo& info = source_->info();
  if (info.live)
    throw Error(info.uri, "a live camera cannot be played faster than it captures",
                "run the session in real time");
  status_.uri = info.uri;
  status_.kind = info.kind;
  status_.sensor = info.sensor;
  status_.rate = info.frame_rate.value_or(0.0);
  status_.state = CameraState::live;
  status_.text = "live";
}

// The next frame whose stamp is of use; none at the end, or after many that are not.
std::optional<Frame> PlayedSource::read() {
  for (int dropped = 0; dropped < most_dropped; ++dropped) {
    std::optional<Frame> frame = source_->next();
    if (!frame) {
      has_ended_ = true;
      return std::nullopt;
    }
    const bool is_first = frames_in_pass_ == 0;
    const bool is_usable = frame->cloud && std::isfinite(frame->stamp);
    const double interval = is_first ? 0.0 : frame->stamp - shown_.source_stamp;  // [s]
    if (is_usable && (is_first || (interval > 0.0 && interval <= longest_gap))) return frame;
    if (is_usable && (interval < -stamp_step_back || interval > longest_gap)) {
      offset_ = last_ + interval_ - frame->stamp;
      has_jumped_ = true;
      ++status_.stamp_problems[static_cast<std::size_t>(StampProblem::jumped)];
      return frame;
    }
    ++status_.dropped;
    ++status_.stamp_problems[static_cast<std::size_t>(StampProblem::not_increasing)];
  }
  return std::nullopt;
}

void PlayedSource::begin() {
  if (next_ || frames_in_pass_ > 0) return;
  next_ = read();
  if (!next_) throw Error(status_.uri, "it has no frames", "give a source with at least one");
  offset_ = -next_->stamp;
}

const Frame& PlayedSource::first_frame() {
  begin();
  return *next_;
}

// The frame after the last: of a recording that is over, the first again, unless it stays.
void PlayedSource::read_next() {
  next_ = read();
  if (next_ || !has_ended_) return;
  if (!open_ || last_ - pass_began_ < shortest_loop) {
    is_still_ = true;
    return;
  }
  source_ = open_();
  frames_in_pass_ = 0;
  has_ended_ = false;
  has_jumped_ = true;
  next_ = read();
  if (!next_) throw Error(status_.uri, "it has no frames any more", "check the recording");
  offset_ = last_ + interval_ - next_->stamp;
}

std::optional<FedFrame> PlayedSource::next_until(double t) {
  begin();
  if (is_still_) {
    if (last_ + still_interval > t) return std::nullopt;
    shown_.frame.stamp = last_ += still_interval;
    shown_.is_new = shown_.after_jump = false;
    status_.stays_valid = true;
    return shown_;
  }
  if (!next_) read_next();
  if (!next_) return std::nullopt;
  const double stamp = next_->stamp + offset_;
  if (stamp > t) return std::nullopt;
  shown_ = {.frame = std::move(*next_), .source_stamp = next_->stamp};
  shown_.after_jump = std::exchange(has_jumped_, false);
  shown_.frame.stamp = stamp;
  if (frames_in_pass_ == 0) {
    pass_began_ = stamp;
  } else if (stamp > last_) {
    interval_ = stamp - last_;
  }
  last_ = stamp;
  ++frames_in_pass_;
  ++status_.frames;
  status_.last_frame = stamp;
  read_next();
  return shown_;
}

}  // namespace palpate
