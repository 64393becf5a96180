// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/camera_feed.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <iterator>
#include <limits>
#include <utility>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr int most_live_errors = 3;        // in a row, before a live camera is opened again
constexpr int most_recording_errors = 10;  // in a row, before a recording is opened again
constexpr double hang_margin = 1.0;        // [s] by which a read may overrun its time-out
constexpr double idle_pause = 0.005;       // [s] after a live source that did not wait
constexpr double rate_weight = 0.1;        // of a new interval in the rate
constexpr double remark_time = 5.0;        // [s] for which a problem of stamps is said
constexpr int frames_a_look = 30;          // between two looks at whether depth is plausible
constexpr std::size_t pixels_a_look = 97;  // every so many of a frame; prime to usual widths
constexpr std::size_t fewest_points = 50;  // of a look, below which it says nothing
constexpr double most_elsewhere = 0.3;     // [-] share of points that may lie out of range

class MachineClock final : public FeedClock {
 public:
  [[nodiscard]] double now() const override { return monotonic_now(); }
  [[nodiscard]] double system_now() const override {
    using std::chrono::duration;
    return duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  }
  void wait(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
            double t) override {
    const double left = std::clamp(t - now(), 0.0, 3600.0);
    changed.wait_for(lock, std::chrono::duration<double>(left));
  }
};

// In hundredths of a metre
std::string metres(double length) {
  const auto count = std::lround(100.0 * length);
  const std::string rest = std::to_string(100 + count % 100).substr(1);
  return std::to_string(count / 100) + "." + rest;
}

std::string tenths(double seconds) {
  const auto count = static_cast<long long>(std::lround(10.0 * seconds));
  return std::to_string(count / 10) + "." + std::to_string(count % 10) + " s";
}

// Are two captures the same to the bit? Points of clouds are not compared.
bool is_same_picture(const Cloud* a, const Cloud* b) {
  if (a == b) return a != nullptr;
  const DepthImage* first = a == nullptr ? nullptr : a->image();
  const DepthImage* second = b == nullptr ? nullptr : b->image();
  return first != nullptr && second != nullptr && first->depth() == second->depth();
}

// What speaks against a frame's unit of depth; empty if nothing does.
std::string doubt_of(const Cloud& cloud, const DepthRange& range) {
  const DepthImage* image = cloud.image();
  if (image == nullptr) return {};
  std::size_t measured = 0;
  std::size_t elsewhere = 0;
  for (std::size_t i = 0; i < image->depth().size(); i += pixels_a_look) {
    if (!is_measured(image->depth()[i])) continue;
    ++measured;
    const double depth = image->depth()[i] / image->units_per_metre();
    if (depth < range.nearest || depth > range.farthest) ++elsewhere;
  }
  const double share = static_cast<double>(elsewhere) / static_cast<double>(measured + 1);
  if (measured < fewest_points || share <= most_elsewhere) return {};
  return std::to_string(std::lround(100.0 * share)) +
         " % of its points are outside the camera's measuring range (" + metres(range.nearest) +
         " to " + metres(range.farthest) + " m): check the unit of its depth values";
}

// Which sentence tells a person of a problem with stamps.
std::string_view remark_of(StampProblem problem) {
  switch (problem) {
    case StampProblem::jumped:
      return "its clock jumped";
    case StampProblem::drifted:
      return "its clock drifted away";
    case StampProblem::from_the_future:
      return "its timestamps are in the future; arrival times are used";
    case StampProblem::too_old:
      return "its frames arrive old";
    case StampProblem::not_increasing:
      return "its timestamps do not increase";
    case StampProblem::none:
      break;
  }
  return "";
}

}  // namespace

std::shared_ptr<FeedClock> machine_clock() {
  static const auto clock = std::make_shared<MachineClock>();
  return clock;
}

// Everything the thread uses; outlives the CameraFeed where the thread hangs.
class CameraFeed::Worker {
 public:
  Worker(std::unique_ptr<Source> source, FeedOptions options, Open open)
      : options_(std::move(options)),
        open_(std::move(open)),
        placer_(source->info().clock, options_.stamps),
        source_(std::move(source)) {
    const SourceInfo& info = source_->info();
    is_live_ = info.live;
    status_.uri = info.uri;
    status_.kind = info.kind;
    status_.sensor = info.sensor;
    status_.rate = info.frame_rate.value_or(0.0);
    status_.recorded = is_live_ ? 0 : info.frames.value_or(0);
    last_heard_ = now();
  }

  // Before the thread.
  std::optional<Frame> first_frame(double timeout) {
    if (first_) return first_->frame;
    first_ = read(timeout);
    if (!first_ && !is_live_)
      throw Error(status_.uri, "it has no frames", "give a source with at least one");
    if (!first_) return std::nullopt;
    return first_->frame;
  }
  void connect(Sink sink) {
    sink_ = std::move(sink);
    is_connected_ = true;
  }

  // The thread.
  void run() {
    {
      const std::lock_guard lock(mutex_);
      last_heard_ = now();
    }
    while (!is_stopping()) {
      if (!source_ && !open_again(true)) continue;
      if (is_live_) {
        run_live();
      } else if (!run_recording()) {
        break;
      }
    }
    set_source(nullptr);
    const std::lock_guard lock(mutex_);
    is_finished_ = true;
    changed_.notify_all();
  }

  // Any thread.
  void request_stop() noexcept {
    std::shared_ptr<Source> source;
    {
      const std::lock_guard lock(mutex_);
      is_stopping_ = true;
      source = source_;
    }
    changed_.notify_all();
    if (source) source->cancel();
    const std::lock_guard lock(sink_mutex_);
    is_connected_ = false;
  }
  bool wait_for_end(double timeout) {
    std::unique_lock lock(mutex_);
    const std::chrono::duration<double> bound(std::clamp(timeout, 0.0, 3600.0));
    return changed_.wait_for(lock, bound, [this] { return is_finished_; });
  }
  void set_playback(const Playback& playback) {
    {
      const std::lock_guard lock(mutex_);
      status_.playback = playback;
    }
    changed_.notify_all();
  }
  void seek(double share) {
    {
      const std::lock_guard lock(mutex_);
      if (!is_live_) sought_ = share;
    }
    changed_.notify_all();
  }
  [[nodiscard]] CameraStatus status() const;

 private:
  struct Read {
    Frame frame;
    double arrival;  // [s]
    double took;     // [s] of reading it
  };

  [[nodiscard]] double now() const { return options_.clock->now(); }
  [[nodiscard]] bool is_stopping() const {
    const std::lock_guard lock(mutex_);
    return is_stopping_;
  }
  bool wait_until(double t);
  std::optional<Read> read(double timeout);
  void set_source(std::shared_ptr<Source> source);
  void look_again(const std::string& trouble);
  bool open_again(bool was_gone);
  void run_live();
  bool run_recording();
  bool go_to(double share, std::size_t& at);
  bool wait_to_show(double stamp, double& offset, bool at_once);
  std::optional<double> take_sought() {
    const std::lock_guard lock(mutex_);
    return std::exchange(sought_, std::nullopt);
  }
  bool stay_at_end();
  void show_again();
  void show_still(const Read& only, double last);
  void take_live(Read read);
  void deliver(FedFrame fed);
  void drop(std::uint64_t count);
  void count(StampProblem problem);
  void set_trouble(const std::string& trouble);
  void set_state(CameraState state);

  const FeedOptions options_;
  const Open open_;

  // The thread's own.
  StampPlacer placer_;
  std::optional<Read> first_;
  std::shared_ptr<const Cloud> newest_;                          // of a live camera
  int same_pictures_ = 0;                                        // in a row
  int frames_seen_ = 0;                                          // since it was opened
  double took_ = 0.0;                                            // [s] to decode the frame before
  double pause_ = 0.0;                                           // [s] before it is opened again
  double last_time_ = -std::numeric_limits<double>::infinity();  // [s] stamp handed over last
  FedFrame shown_;            // of a recording: the frame handed over last
  double first_stamp_ = 0.0;  // [s] of a recording's first frame, by its own clock
  bool has_jumped_ = false;   // in time, before the frame to come
  double speed_ = 1.0;        // of the recording, which the offset of its stamps is for
  std::atomic<bool> is_live_{false};

  mutable std::mutex mutex_;  // for all below
  std::condition_variable changed_;
  std::shared_ptr<Source> source_;
  bool is_stopping_ = false, is_finished_ = false;
  CameraStatus status_;
  double last_heard_ = 0.0;           // [s] when the last frame came
  bool is_starting_ = true;           // no frame since it was opened
  std::optional<double> read_until_;  // [s] when the read that continues must have ended
  StampProblem last_problem_ = StampProblem::none;
  double last_problem_time_ = 0.0;  // [s]
  std::optional<double> sought_;    // place in the recording that was asked for, 0 to 1

  // Held while the sink is called. Recursive: a sink may stop its own camera.
  std::recursive_mutex sink_mutex_;
  Sink sink_;
  bool is_connected_ = false;
};

// False if the camera is to stop.
bool CameraFeed::Worker::wait_until(double t) {
  std::unique_lock lock(mutex_);
  while (!is_stopping_ && now() < t) options_.clock->wait(lock, changed_, t);
  return !is_stopping_;
}

// The source's next frame. @throws what it throws
std::optional<CameraFeed::Worker::Read> CameraFeed::Worker::read(double timeout) {
  const double begin = now();
  {
    const std::lock_guard lock(mutex_);
    read_until_ = begin + std::min(timeout, hang_margin);
  }
  struct Done {
    Worker& worker;
    ~Done() {
      const std::lock_guard lock(worker.mutex_);
      worker.read_until_.reset();
    }
  } const done{*this};
  std::optional<Frame> frame = source_->next(timeout);
  const double end = now();
  if (!frame || !frame->cloud) return std::nullopt;
  const double arrival = std::min(frame->arrival.value_or(end), end);
  return Read{std::move(*frame), arrival, end - begin};
}

// The one before is destroyed here, on the camera's thread: closing it may take its time.
void CameraFeed::Worker::set_source(std::shared_ptr<Source> source) {
  {
    const std::lock_guard lock(mutex_);
    std::swap(source_, source);
    if (source_ && is_stopping_) source_->cancel();
  }
  source.reset();
}

void CameraFeed::Worker::set_state(CameraState state) {
  const std::lock_guard lock(mutex_);
  status_.state = state;
}

void CameraFeed::Worker::set_trouble(const std::string& trouble) {
  const std::lock_guard lock(mutex_);
  status_.trouble = trouble;
}

void CameraFeed::Worker::drop(std::uint64_t count) {
  const std::lock_guard lock(mutex_);
  status_.dropped += count;
}

void CameraFeed::Worker::count(StampProblem problem) {
  if (problem == StampProblem::none) return;
  const std::lock_guard lock(mutex_);
  ++status_.stamp_problems[static_cast<std::size_t>(problem)];
  last_problem_ = problem;
  last_problem_time_ = now();
}

// Closes the source, or keeps one that cannot be opened again, and waits before the next attempt.
void CameraFeed::Worker::look_again(const std::string& trouble) {
  {
    const std::lock_guard lock(mutex_);
    if (is_stopping_) return;
    status_.trouble = trouble;
    status_.state = CameraState::searching;
  }
  if (open_) set_source(nullptr);
  pause_ = pause_ > 0.0 ? std::min(2.0 * pause_, options_.longest_pause) : options_.first_pause;
  wait_until(now() + pause_);
}

bool CameraFeed::Worker::open_again(bool was_gone) {
  try {
    std::unique_ptr<Source> source = open_();
    if (!source) throw Error(status_.uri, "nothing was opened");
    is_live_ = source->info().live;
    placer_.restart(source->info().clock);
    same_pictures_ = 0;
    frames_seen_ = 0;
    newest_.reset();
    set_source(std::move(source));
    const std::lock_guard lock(mutex_);
    status_.opened_again += was_gone ? 1 : 0;
    if (was_gone) status_.state = CameraState::waiting;
    last_heard_ = now();
    is_starting_ = true;
    return true;
  } catch (const std::exception& error) {
    look_again(error.what());
    return false;
  }
}

// A live camera, until it is to stop or is gone.
void CameraFeed::Worker::run_live() {
  if (first_) take_live(*std::exchange(first_, std::nullopt));
  for (int errors = 0; !is_stopping();) {
    const double begin = now();
    std::optional<Read> frame;
    try {
      frame = read(options_.waiting);
    } catch (const std::exception& error) {
      set_trouble(error.what());
      drop(1);
      if (++errors < most_live_errors) continue;
      look_again(error.what());
      return;
    }
    const double end = now();
    if (frame) {
      errors = 0;
      take_live(std::move(*frame));
      continue;
    }
    if (is_stopping()) return;
    double silent = 0.0;
    double bound = options_.silence;
    {
      const std::lock_guard lock(mutex_);
      silent = end - last_heard_;
      if (silent >= options_.waiting) status_.state = CameraState::waiting;
      if (is_starting_) bound = options_.start_up;
    }
    if (silent >= bound) {
      look_again("it has delivered nothing for " + tenths(silent));
      const std::lock_guard lock(mutex_);
      last_heard_ = now();  // a source that cannot be opened again gets its time once more
      return;
    }
    if (end - begin < 0.5 * idle_pause) wait_until(end + idle_pause);
  }
}

void CameraFeed::Worker::take_live(Read read) {
  {
    const std::lock_guard lock(mutex_);
    last_heard_ = std::max(read.arrival, last_heard_);
    is_starting_ = false;
    status_.trouble.clear();
  }
  pause_ = 0.0;
  const double known = options_.clock->now() - options_.clock->system_now();
  const StampClock clock = source_->info().clock;
  const double stamp = read.frame.stamp;
  const PlacedStamp placed =
      placer_.place(stamp, read.arrival, clock == StampClock::system ? known : 0.0);
  count(placed.problem);
  same_pictures_ = is_same_picture(newest_.get(), read.frame.cloud.get()) ? same_pictures_ + 1 : 1;
  newest_ = read.frame.cloud;
  if (const auto& range = source_->info().range; range && frames_seen_++ % frames_a_look == 0) {
    const std::string doubt = doubt_of(*newest_, *range);
    const std::lock_guard lock(mutex_);
    status_.doubt = doubt;
  }
  const bool is_frozen = same_pictures_ >= options_.frozen_frames;
  {
    const std::lock_guard lock(mutex_);
    status_.latency = placer_.latency();
    status_.state = is_frozen ? CameraState::frozen : CameraState::live;
  }
  if (is_frozen || !placed.usable || !(placed.time > last_time_)) {
    drop(1);
    return;
  }
  read.frame.stamp = placed.time;
  deliver({std::move(read.frame), stamp, true});
}

// Goes to another place of the recording, which is at frame `at`. False: it has to be opened again.
bool CameraFeed::Worker::go_to(double share, std::size_t& at) {
  const std::size_t count = source_->info().frames.value_or(0);
  if (count < 2) return true;
  const auto wanted = static_cast<std::size_t>(std::lround(share * static_cast<double>(count - 1)));
  if (wanted < at) {
    if (!open_) return true;
    set_source(nullptr);
    if (!open_again(false)) return false;
    at = 0;
  }
  while (at < wanted) {
    const std::size_t skipped = source_->skip(wanted - at);
    at += skipped > 0 ? skipped : 1;
    if (skipped == 0 && !read(Source::no_timeout)) break;
  }
  has_jumped_ = true;
  return true;
}

// The frame that was shown last, once more.
void CameraFeed::Worker::show_again() {
  FedFrame again = shown_;
  again.frame.stamp = std::max(last_time_ + options_.still_interval, now());
  again.is_new = false;
  again.after_jump = false;
  deliver(std::move(again));
}

// Waits until a frame is due, at `stamp / speed_ + offset`, and while the recording is paused,
// unless it is the first of a place. False: not to be shown, as the camera is to stop or goes
// elsewhere.
bool CameraFeed::Worker::wait_to_show(double stamp, double& offset, bool is_first) {
  for (bool was_paused = false;;) {
    {
      std::unique_lock lock(mutex_);
      if (is_stopping_ || sought_) return false;
      const Playback& playback = status_.playback;
      const bool is_paused = playback.paused && !is_first;
      if (playback.speed != speed_ || (was_paused && !is_paused)) {
        // On from the frame that was shown last.
        speed_ = playback.speed;
        const double after = std::max(stamp - shown_.source_stamp, 0.0) / speed_;
        offset = std::max(now(), last_time_) + after - stamp / speed_;
      }
      was_paused = is_paused;
      const double wake =
          is_paused ? last_time_ + options_.still_interval : stamp / speed_ + offset;
      if (now() < wake) {
        options_.clock->wait(lock, changed_, wake);
        continue;
      }
      if (!is_paused) return true;
    }
    show_again();
  }
}

// After the last frame: pauses there, unless the recording begins again. False: the camera is to
// stop.
bool CameraFeed::Worker::stay_at_end() {
  {
    const std::lock_guard lock(mutex_);
    if (status_.playback.loop) return !is_stopping_;
    status_.playback.paused = true;
  }
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      const double wake = last_time_ + options_.still_interval;
      if (is_stopping_) return false;
      if (sought_ || !status_.playback.paused) return true;
      if (now() < wake) {
        options_.clock->wait(lock, changed_, wake);
        continue;
      }
    }
    show_again();
  }
}

// One pass of a recording. False if it is over for good.
bool CameraFeed::Worker::run_recording() {
  std::optional<Read> next = std::exchange(first_, std::nullopt);
  std::optional<Read> only;  // the first frame while it is the only one
  std::size_t frames = 0;    // of this pass, left-out ones included
  double offset = 0.0;       // [s] from the recording's clock to the loop's
  double last_stamp = 0.0;   // [s] by the recording's clock
  int errors = 0;
  const double period =
      source_->info().frame_rate.value_or(0.0) > 0.0 ? 1.0 / *source_->info().frame_rate : 0.0;
  for (;;) {
    if (is_stopping()) return true;
    if (const std::optional<double> share = take_sought()) {
      next.reset();
      only.reset();
      if (!go_to(*share, frames)) return true;
    }
    if (!next) {
      // Decoding is too slow: leave out the frames that would be late.
      if (frames > 0 && period > 0.0 && !has_jumped_) {
        const double behind = now() + took_ - ((last_stamp + period) / speed_ + offset);
        if (behind > period / speed_) {
          const auto late = static_cast<std::size_t>(behind * speed_ / period);
          const std::size_t skipped = source_->skip(late);
          frames += skipped;
          drop(skipped);
        }
      }
      try {
        next = read(Source::no_timeout);
      } catch (const std::exception& error) {
        set_trouble(error.what());
        drop(1);
        ++frames;
        if (++errors < most_recording_errors) continue;
        look_again(error.what());
        return true;
      }
    }
    if (!next) break;
    errors = 0;
    took_ = frames > 0 ? next->took : 0.0;  // the first frame takes longer than others
    const double stamp = next->frame.stamp;
    if (!std::isfinite(stamp) || (frames > 0 && !has_jumped_ && stamp <= last_stamp &&
                                  last_stamp - stamp < stamp_step_back)) {
      count(StampProblem::not_increasing);
      drop(1);
      ++frames;
      next.reset();
      continue;
    }
    const double earliest = std::max(now(), last_time_ + options_.still_interval);
    const bool was_sought = has_jumped_ && frames > 0;
    const bool has_jumped = frames > 0 && !was_sought &&
                            (stamp < last_stamp || stamp - last_stamp > options_.longest_gap);
    const bool is_behind =
        frames > 0 && !was_sought && now() - (stamp / speed_ + offset) > options_.longest_lag;
    if (frames == 0 || was_sought || has_jumped || is_behind) offset = earliest - stamp / speed_;
    if (has_jumped) count(StampProblem::jumped);
    if (has_jumped) has_jumped_ = true;
    if (frames == 0) first_stamp_ = stamp;
    if (is_behind && !has_jumped) {
      const std::lock_guard lock(mutex_);
      ++status_.slowed;
    }
    last_stamp = stamp;
    if (++frames == 1) only = *next;
    if (frames == 2) only.reset();
    if (!wait_to_show(stamp, offset, frames == 1 || has_jumped_)) continue;
    const double due = stamp / speed_ + offset;
    pause_ = 0.0;
    {
      const std::lock_guard lock(mutex_);
      last_heard_ = now();
      status_.state = CameraState::live;
      status_.place = frames - 1;
      status_.recorded_time = stamp - first_stamp_;
    }
    Frame frame = std::move(next->frame);
    next.reset();
    frame.stamp = due;
    if (due > last_time_) {
      shown_ = {std::move(frame), stamp, true, std::exchange(has_jumped_, false)};
      deliver(shown_);
    } else {
      count(StampProblem::not_increasing);
      drop(1);
    }
  }
  if (is_stopping()) return true;
  if (frames == 0 && open_) {
    look_again("it has no frames");
    return true;
  }
  if (only && frames == 1) {
    {
      const std::lock_guard lock(mutex_);
      status_.kind += ", one frame";
    }
    show_still(*only, last_time_);
    return true;
  }
  if (!open_) {
    set_state(CameraState::ended);
    while (frames > 0 && wait_until(last_time_ + options_.still_interval)) show_again();
    return false;
  }
  if (!stay_at_end()) return true;
  has_jumped_ = true;
  set_source(nullptr);
  open_again(false);
  return true;
}

// The only frame of a recording, again and again until the camera is to stop.
void CameraFeed::Worker::show_still(const Read& only, double last) {
  while (wait_until(last + options_.still_interval)) {
    last = std::max(last + options_.still_interval, now());
    Frame frame = only.frame;
    frame.stamp = last;
    deliver({std::move(frame), only.frame.stamp, false});
  }
}

void CameraFeed::Worker::deliver(FedFrame fed) {
  const double interval = fed.frame.stamp - last_time_;
  last_time_ = fed.frame.stamp;
  {
    const std::lock_guard lock(mutex_);
    if (fed.is_new) {
      ++status_.frames;
      if (std::isfinite(interval) && interval > 0.0) {
        // The mean of intervals: two frames that come at once would rule a mean of rates.
        const double mean = status_.rate > 0.0 ? 1.0 / status_.rate : interval;
        status_.rate = 1.0 / (mean + rate_weight * (interval - mean));
      }
    }
    status_.last_frame = fed.frame.stamp;
    status_.stays_valid = !fed.is_new;
  }
  const std::lock_guard lock(sink_mutex_);
  if (is_connected_) sink_(fed);
}

CameraStatus CameraFeed::Worker::status() const {
  const std::lock_guard lock(mutex_);
  const double time = now();
  CameraStatus status = status_;
  const double silent = time - last_heard_;
  const bool hangs = read_until_ && time > *read_until_ + hang_margin;
  if (is_stopping_) status.state = CameraState::stopped;
  const std::string because = status.trouble.empty() ? "" : ": " + status.trouble;
  switch (status.state) {
    case CameraState::waiting:
      status.text = "waiting: no frame for " + tenths(silent) + because;
      break;
    case CameraState::live:
      status.text = "live";
      break;
    case CameraState::frozen:
      status.text = "frozen: it sends the same image repeatedly";
      break;
    case CameraState::searching:
      status.text = "looking for it again" + because;
      break;
    case CameraState::ended:
      status.text = status.stays_valid ? "ended, its last frame stays" : "ended";
      break;
    case CameraState::stopped:
      status.text = "stopped";
      break;
  }
  if (hangs && !is_stopping_) {
    status.state = CameraState::waiting;
    status.text = "it hangs: no frame for " + tenths(silent);
  } else if (status.state == CameraState::live && last_problem_ != StampProblem::none &&
             time - last_problem_time_ < remark_time) {
    status.text += "; " + std::string(remark_of(last_problem_));
  } else if (status.state == CameraState::live && !status.doubt.empty()) {
    status.text += "; " + status.doubt;
  }
  return status;
}

CameraFeed::CameraFeed(const std::string& uri, FeedOptions options)
    : CameraFeed(open_source(uri, options.schemes), options,
                 [uri, schemes = options.schemes] { return open_source(uri, schemes); }) {}

CameraFeed::CameraFeed(std::unique_ptr<Source> source, FeedOptions options, Open open) {
  if (!source) throw Error("camera", "there is no source", "give an open one");
  info_ = source->info();
  worker_ = std::make_shared<Worker>(std::move(source), std::move(options), std::move(open));
}

CameraFeed::~CameraFeed() {
  stop();
}

std::optional<Frame> CameraFeed::first_frame(double timeout) {
  return worker_->first_frame(timeout);
}

void CameraFeed::start(Sink sink) {
  if (thread_.joinable()) return;
  worker_->connect(std::move(sink));
  thread_ = std::thread([worker = worker_] { worker->run(); });
}

void CameraFeed::request_stop() noexcept {
  worker_->request_stop();
}

bool CameraFeed::join(double timeout) {
  if (!thread_.joinable()) return true;
  if (!worker_->wait_for_end(timeout)) return false;
  thread_.join();
  return true;
}

bool CameraFeed::stop(double timeout) {
  request_stop();
  if (join(timeout)) return true;
  thread_.detach();
  return false;
}

void CameraFeed::set_playback(const Playback& playback) {
  if (!(playback.speed >= Playback::slowest && playback.speed <= Playback::fastest))
    throw Error("playback", "a speed of " + number_text(playback.speed) + " is out of range",
                "give " + number_text(Playback::slowest) + " to " + number_text(Playback::fastest));
  worker_->set_playback(playback);
}

void CameraFeed::seek(double share) {
  if (!(share >= 0.0 && share <= 1.0))
    throw Error("playback", "there is no position " + number_text(share) + " in a recording",
                "give 0, its beginning, to 1, its end");
  worker_->seek(share);
}

CameraStatus CameraFeed::status() const {
  return worker_->status();
}

}  // namespace palpate
