// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/player.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr int most_reads = 100;          // of one look, which leaves out as many frames
constexpr double stamp_step_back = 1.0;  // [s] by which stamps go back where a recording restarts
constexpr double longest_gap = 10.0;     // [s] between frames beyond which it is cut short
constexpr double longest_lag = 1.0;      // [s] behind its stamps beyond which it is slowed down
constexpr double never = std::numeric_limits<double>::infinity();

void count(CameraStatus& status, StampProblem problem) {
  ++status.stamp_problems[static_cast<std::size_t>(problem)];
}

}  // namespace

Player::Player(std::shared_ptr<Source> source, Open open, Playing playing)
    : source_(std::move(source)), open_(std::move(open)), playing_(playing) {
  const SourceInfo& info = source_->info();
  if (gives_frames_later()) playing_ = Playing::by_its_stamps;
  if (info.live && playing_ == Playing::freely)
    throw Error(info.uri, "a live camera cannot be played faster than it captures",
                "run the session in real time");
  status_ = {.uri = info.uri,
             .kind = info.kind,
             .sensor = info.sensor,
             .rate = info.frame_rate.value_or(0.0),
             .body = info.body,
             .doubt = info.assumed,
             .recorded = info.live ? 0 : info.frames.value_or(0)};
  if (playing_ == Playing::in_real_time) return;
  status_.state = CameraState::live;
  status_.text = "live";
}

void Player::close() {
  source_.reset();
  next_.reset();
  at_ = given_ = 0;
  has_ended_ = stays_ = false;
  is_new_place_ = true;
}

void Player::set_playback(const Playback& playback, double now) {
  const Playback before = std::exchange(status_.playback, playback);
  const bool is_resumed = before.paused && !playback.paused;
  if (!is_resumed && playback.speed == before.speed) return;
  // On from the frame that was shown last.
  offset_ = std::max(now, last_) - shown_.source_stamp / playback.speed;
  if (is_new_place_) is_placed_ = false;
}

void Player::seek(double share) {
  if (status_.recorded < 2) return;
  const auto last = static_cast<double>(status_.recorded - 1);
  const auto wanted = static_cast<std::size_t>(std::lround(share * last));
  if (wanted < at_ || has_ended_) {
    if (!open_) return;
    close();
  }
  next_.reset();
  sought_ = wanted;
  is_new_place_ = true;
}

// Where decoding is too slow: leaves out the frames that would be late.
void Player::leave_out_late(double now, double took) {
  const double rate = source_->info().frame_rate.value_or(0.0) * status_.playback.speed;
  if (is_new_place_ || !(rate > 0.0)) return;
  if (at_ < 2) took = 0.0;  // the first frame takes longer than others
  const double due = shown_.source_stamp / status_.playback.speed + offset_ + 1.0 / rate;
  const double late = (now + took - due) * rate;  // in frames
  if (!(late > 1.0)) return;
  const std::size_t skipped = source_->skip(static_cast<std::size_t>(late));
  at_ += skipped;
  status_.dropped += skipped;
}

void Player::leave_out() {
  ++status_.dropped;
  count(status_, StampProblem::not_increasing);
}

void Player::read(double now, double took) {
  if (at_ < sought_)
    at_ += source_->skip(sought_ - at_);
  else
    leave_out_late(now, took);
  std::optional<Frame> frame;
  try {
    frame = source_->next();
  } catch (...) {
    ++at_;
    ++status_.dropped;
    throw;
  }
  if (!frame && gives_frames_later()) return;
  if (!frame)
    end();
  else if (++at_ > sought_)
    keep(std::move(*frame));
}

// For next_until, unless its stamp cannot be true.
void Player::keep(Frame frame) {
  const double interval = frame.stamp - shown_.source_stamp;  // [s]
  const bool is_later = is_new_place_ || interval > 0.0 || interval < -stamp_step_back;
  if (!frame.cloud || !std::isfinite(frame.stamp) || !is_later) {
    leave_out();
    return;
  }
  if (!is_new_place_ && (interval < 0.0 || interval > longest_gap)) {
    count(status_, StampProblem::jumped);
    is_new_place_ = true;
  }
  if (given_ == 0 && sought_ == 0) first_stamp_ = frame.stamp;
  next_ = std::move(frame);
  sought_ = 0;
  is_placed_ = false;
}

// After the last frame of a pass.
void Player::end() {
  has_ended_ = true;
  const bool is_empty = std::exchange(sought_, 0) == 0 && given_ == 0;
  const bool is_only = at_ == 1 && given_ == 1;
  if (is_only) status_.recorded = 1;
  stays_ =
      is_only || !open_ || (playing_ == Playing::freely && last_ - pass_began_ < shortest_loop);
  if (!open_ && !is_only) status_.state = CameraState::ended;
  if (!stays_ && !is_empty && !status_.playback.loop) status_.playback.paused = true;
  if (!is_empty) return;
  if (open_) close();
  throw Error(status_.uri, status_.frames > 0 ? "it has no frames any more" : "it has no frames",
              status_.frames > 0 ? "check the recording" : "give a source with at least one");
}

const Frame* Player::look_ahead() {
  for (int reads = 0; needs_frame() && reads < most_reads; ++reads) {
    if (needs_source()) {
      close();
      begin(open_());
    }
    read();
    if (gives_frames_later()) break;
  }
  return upcoming();
}

const Frame& Player::first_frame() {
  if (const Frame* first = look_ahead()) return *first;
  throw Error(status_.uri, "it has no frames", "give a source with at least one");
}

double Player::due(double now) {
  if (is_still()) {
    const bool is_repeated = status_.frames > 0 && playing_ != Playing::by_its_stamps;
    return is_repeated ? last_ + still_interval : never;
  }
  if (!next_) return -never;
  const double stamp = next_->stamp / status_.playback.speed;
  if (!std::exchange(is_placed_, true) && playing_ != Playing::by_its_stamps) {
    const bool is_behind = !is_new_place_ && now - (stamp + offset_) > longest_lag;
    if (is_behind) ++status_.slowed;
    if (is_behind || is_new_place_) offset_ = std::max(now, last_ + interval_) - stamp;
  }
  return stamp + offset_;
}

std::optional<FedFrame> Player::next_until(double t) {
  look_ahead();
  if (needs_frame() || due(t) > t) return std::nullopt;
  return is_still() ? again(t) : show();
}

// The frame that was shown last; of several repetitions that are late, the last.
FedFrame Player::again(double t) {
  last_ += still_interval * std::max(1.0, std::floor((t - last_) / still_interval));
  status_.last_frame = shown_.frame.stamp = last_;
  status_.stays_valid = true;
  shown_.is_new = shown_.after_jump = false;
  return shown_;
}

std::optional<FedFrame> Player::show() {
  Frame frame = std::move(*next_);
  next_.reset();
  const double source_stamp = frame.stamp;
  frame.stamp = source_stamp / status_.playback.speed + offset_;
  if (!(frame.stamp > last_) && playing_ != Playing::by_its_stamps) {
    leave_out();
    return std::nullopt;
  }
  if (given_++ == 0)
    pass_began_ = frame.stamp;
  else
    interval_ = frame.stamp - last_;
  last_ = frame.stamp;
  shown_ = {.frame = std::move(frame),
            .source_stamp = source_stamp,
            .after_jump = std::exchange(is_new_place_, false) && status_.frames > 0};
  ++status_.frames;
  status_.state = CameraState::live;
  status_.last_frame = last_;
  status_.stays_valid = false;
  status_.place = at_ - 1;
  status_.recorded_time = source_stamp - first_stamp_;
  return shown_;
}

}  // namespace palpate
