// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/camera_feed.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>
#include <utility>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/parameters.hpp"
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

// Of each CameraState.
constexpr std::array<const char*, 6> state_words{
    "waiting: no frame for ", "live",  "frozen: it sends the same image repeatedly",
    "looking for it again",   "ended", "stopped"};
// Of each StampProblem.
constexpr std::array<const char*, stamp_problem_count> problem_words{
    "",
    "its clock jumped",
    "its clock drifted away",
    "its timestamps are in the future; arrival times are used",
    "its frames arrive old",
    "its timestamps do not increase"};

class MachineClock final : public FeedClock {
 public:
  [[nodiscard]] double now() const override { return monotonic_now(); }
  [[nodiscard]] double system_start() const override {
    return 1e-9 * static_cast<double>(since_1970(0.0));
  }
  void wait(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
            double t) override {
    const double left = std::clamp(t - now(), 0.0, 3600.0);
    changed.wait_for(lock, std::chrono::duration<double>(left));
  }
};

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
         " % of its points are outside the camera's measuring range (" +
         fixed_text(range.nearest, 2) + " to " + fixed_text(range.farthest, 2) +
         " m): check the unit of its depth values";
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
        source_(std::move(source)),
        is_live_(source_->info().live),
        player_(source_, open_, Playing::in_real_time),
        placer_(source_->info().clock),
        status_(player_.status()) {}

  // Before the thread.
  std::optional<Frame> first_frame(double timeout) {
    if (!is_live_) return player_.first_frame();
    if (!first_) first_ = read(timeout);
    return first_;
  }
  void connect(Sink sink, Hand hand) {
    sink_ = std::move(sink);
    hand_ = std::move(hand);
    is_connected_ = true;
  }

  // The thread.
  void run() {
    last_heard_ = now();
    while (!is_stopping()) {
      if (!source_ && !open_again()) continue;
      if (is_live_) {
        run_live();
      } else if (!run_recording()) {
        break;
      }
    }
    close();
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
    const std::lock_guard lock(mutex_);
    wanted_ = status_.playback = playback;
    changed_.notify_all();
  }
  void seek(double share) {
    const std::lock_guard lock(mutex_);
    if (!is_live_) sought_ = share;
    changed_.notify_all();
  }
  [[nodiscard]] CameraStatus status() const {
    const std::lock_guard lock(mutex_);
    const double time = now();
    CameraStatus status = status_;
    if (status.recorded == 1) status.kind += ", one frame";
    const std::string silent = fixed_text(time - last_heard_, 1) + " s";
    const bool hangs = read_until_ && time > *read_until_ + hang_margin;
    if (is_stopping_) status.state = CameraState::stopped;
    status.text = state_words[static_cast<std::size_t>(status.state)];
    if (status.state == CameraState::waiting) status.text += silent;
    if (status.state == CameraState::ended && status.stays_valid)
      status.text += ", its last frame stays";
    if (status.state == CameraState::waiting || status.state == CameraState::searching)
      status.text += status.trouble.empty() ? "" : ": " + status.trouble;
    if (hangs && !is_stopping_) {
      status.state = CameraState::waiting;
      status.text = "it hangs: no frame for " + silent;
    } else if (status.state == CameraState::live && last_problem_ != StampProblem::none &&
               time - last_problem_time_ < remark_time) {
      status.text += "; " + std::string(problem_words[static_cast<std::size_t>(last_problem_)]);
    } else if (status.state == CameraState::live && !status.doubt.empty()) {
      status.text += "; " + status.doubt;
    }
    return status;
  }

 private:
  // While it lives, the source is read: `status` says so where that hangs.
  struct Watch {
    Watch(Worker& of, double timeout) : worker(of) {
      const std::lock_guard lock(worker.mutex_);
      worker.publish();
      worker.read_until_ = worker.now() + std::min(timeout, hang_margin);
    }
    ~Watch() {
      const std::lock_guard lock(worker.mutex_);
      worker.read_until_.reset();
    }
    Worker& worker;
  };

  [[nodiscard]] double now() const { return options_.clock->now(); }
  [[nodiscard]] bool is_stopping() const {
    const std::lock_guard lock(mutex_);
    return is_stopping_;
  }
  // With mutex_ held: what others see from now on.
  void publish() {
    const CameraStatus& status = player_.status();
    for (std::size_t i = 0; i < stamp_problem_count; ++i) {
      if (status.stamp_problems[i] == status_.stamp_problems[i]) continue;
      last_problem_ = static_cast<StampProblem>(i);
      last_problem_time_ = now();
    }
    status_ = status;
    if (wanted_) status_.playback = *wanted_;
  }
  // Unless the camera is to stop.
  void wait_until(double t) {
    std::unique_lock lock(mutex_);
    publish();
    while (!is_stopping_ && now() < t) options_.clock->wait(lock, changed_, t);
  }
  // The one before is destroyed here, on the camera's thread: closing it may take its time.
  void set_source(std::shared_ptr<Source> source) {
    {
      const std::lock_guard lock(mutex_);
      publish();
      std::swap(source_, source);
      if (source_ && is_stopping_) source_->cancel();
    }
    source.reset();
  }
  void close() {
    player_.close();
    set_source(nullptr);
  }
  // Closes the source, or keeps one that cannot be opened again, and waits before the next attempt.
  void look_again(const std::string& trouble) {
    player_.status().trouble = trouble;
    player_.status().state = CameraState::searching;
    if (open_) close();
    pause_ = pause_ > 0.0 ? std::min(2.0 * pause_, options_.longest_pause) : options_.first_pause;
    wait_until(now() + pause_);
  }
  bool open_again() {
    try {
      std::shared_ptr<Source> source = open_();
      if (!source) throw Error(player_.status().uri, "nothing was opened");
      is_live_ = source->info().live;
      placer_.restart(source->info().clock);
      same_pictures_ = frames_seen_ = 0;
      newest_.reset();
      set_source(std::move(source));
      player_.begin(source_);
      CameraStatus& status = player_.status();
      if (status.state == CameraState::searching) {
        ++status.opened_again;
        status.state = CameraState::waiting;
      }
      last_heard_ = now();
      is_starting_ = true;
      return true;
    } catch (const std::exception& error) {
      look_again(error.what());
      return false;
    }
  }
  // A recording, until it is to stop or has to be opened again. False: it is over.
  bool run_recording() {
    for (int errors = 0;;) {
      {
        std::unique_lock lock(mutex_);
        if (is_stopping_) return true;
        if (const auto wanted = std::exchange(wanted_, std::nullopt))
          player_.set_playback(*wanted, now());
        if (const auto share = std::exchange(sought_, std::nullopt)) player_.seek(*share);
        publish();
        const double due = player_.due(now());
        if (!open_ && due == std::numeric_limits<double>::infinity()) return false;
        if (now() < due) {
          options_.clock->wait(lock, changed_, due);
          continue;
        }
      }
      if (player_.needs_source()) {
        close();
        return true;
      }
      if (player_.needs_frame()) {
        if (!read_ahead(errors)) return true;
      } else if (const auto fed = player_.next_until(now())) {
        if (fed->is_new) last_heard_ = now();
        pause_ = 0.0;
        deliver(*fed);
      }
    }
  }
  // Reads a recording's next frame. False: it has been closed, or kept for a while, for its faults.
  bool read_ahead(int& errors) {
    const double begin = now();
    try {
      const Watch watch(*this, Source::no_timeout);
      follow();
      player_.read(begin, took_);
      took_ = now() - begin;
      errors = 0;
      return true;
    } catch (const std::exception& error) {
      player_.status().trouble = error.what();
      if (++errors < most_recording_errors && !player_.needs_source()) return true;
      look_again(error.what());
      return false;
    }
  }
  // A live camera, until it is to stop or is gone.
  void run_live() {
    if (first_) take_live(*std::exchange(first_, std::nullopt));
    for (int errors = 0; !is_stopping();) {
      const double begin = now();
      std::optional<Frame> frame;
      try {
        frame = read(options_.waiting);
      } catch (const std::exception& error) {
        player_.status().trouble = error.what();
        ++player_.status().dropped;
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
      const double silent = end - last_heard_;
      if (silent >= options_.waiting) player_.status().state = CameraState::waiting;
      if (silent >= (is_starting_ ? options_.start_up : options_.silence)) {
        look_again("it has delivered nothing for " + fixed_text(silent, 1) + " s");
        last_heard_ = now();  // a source that cannot be opened again gets its time once more
        return;
      }
      if (end - begin < 0.5 * idle_pause) wait_until(end + idle_pause);
    }
  }
  void follow() {
    std::optional<Vec3> hand;
    {
      const std::lock_guard lock(sink_mutex_);
      if (is_connected_ && hand_) hand = hand_();
    }
    if (hand && source_) source_->follow(*hand);
  }
  // A live camera's next frame, with its arrival. @throws what its source throws
  std::optional<Frame> read(double timeout) {
    const Watch watch(*this, timeout);
    follow();
    std::optional<Frame> frame = source_->next(timeout);
    const double end = now();
    if (!frame || !frame->cloud) return std::nullopt;
    frame->arrival = std::min(frame->arrival.value_or(end), end);
    return frame;
  }
  void take_live(Frame frame) {
    CameraStatus& status = player_.status();
    const double arrival = frame.arrival.value_or(now());
    last_heard_ = std::max(arrival, last_heard_.load());
    is_starting_ = false;
    status.trouble.clear();
    pause_ = 0.0;
    const double known = -options_.clock->system_start();
    const StampClock clock = source_->info().clock;
    const double stamp = frame.stamp;
    const PlacedStamp placed =
        placer_.place(stamp, arrival, clock == StampClock::system ? known : 0.0);
    if (placed.problem != StampProblem::none)
      ++status.stamp_problems[static_cast<std::size_t>(placed.problem)];
    same_pictures_ = is_same_picture(newest_.get(), frame.cloud.get()) ? same_pictures_ + 1 : 1;
    newest_ = frame.cloud;
    if (const auto& range = source_->info().range; range && frames_seen_++ % frames_a_look == 0)
      status.doubt = doubt_of(*newest_, *range);
    // Hazard: frozen-image
    const bool is_frozen = same_pictures_ >= options_.frozen_frames;
    status.latency = placer_.latency();
    status.state = is_frozen ? CameraState::frozen : CameraState::live;
    if (is_frozen || !placed.usable || !(placed.time > last_time_)) {
      ++status.dropped;
      return;
    }
    ++status.frames;
    status.last_frame = frame.stamp = placed.time;
    status.stays_valid = false;
    deliver({std::move(frame), stamp});
  }
  void deliver(const FedFrame& fed) {
    const double interval = fed.frame.stamp - last_time_;
    last_time_ = fed.frame.stamp;
    if (double& rate = player_.status().rate;
        fed.is_new && std::isfinite(interval) && interval > 0.0) {
      // The mean of intervals: two frames that come at once would rule a mean of rates.
      const double mean = rate > 0.0 ? 1.0 / rate : interval;
      rate = 1.0 / (mean + rate_weight * (interval - mean));
    }
    {
      const std::lock_guard lock(mutex_);
      publish();
    }
    const std::lock_guard lock(sink_mutex_);
    if (is_connected_) sink_(fed);
  }

  const FeedOptions options_;
  const Open open_;

  std::shared_ptr<Source> source_;  // the thread alone changes it, with mutex_ held
  std::atomic<bool> is_live_;
  std::atomic<double> last_heard_{now()};  // [s] when the last frame came

  // The thread's own.
  Player player_;  // has the status of a live camera, too
  StampPlacer placer_;
  std::optional<Frame> first_;                                   // of a live camera
  std::shared_ptr<const Cloud> newest_;                          // of a live camera
  int same_pictures_ = 0;                                        // in a row
  int frames_seen_ = 0;                                          // since it was opened
  double took_ = 0.0;                                            // [s] to decode the frame before
  double pause_ = 0.0;                                           // [s] before it is opened again
  double last_time_ = -std::numeric_limits<double>::infinity();  // [s] stamp handed over last
  bool is_starting_ = true;                                      // no frame since it was opened

  mutable std::mutex mutex_;  // for all below
  std::condition_variable changed_;
  bool is_stopping_ = false, is_finished_ = false;
  CameraStatus status_;               // as published
  std::optional<double> read_until_;  // [s] when the read that continues must have ended
  StampProblem last_problem_ = StampProblem::none;
  double last_problem_time_ = 0.0;  // [s]
  std::optional<Playback> wanted_;  // asked for, and not yet the player's
  std::optional<double> sought_;    // place in the recording that was asked for, 0 to 1

  // Held while the sink is called. Recursive: a sink may stop its own camera.
  std::recursive_mutex sink_mutex_;
  Sink sink_;
  Hand hand_;
  bool is_connected_ = false;
};

CameraFeed::CameraFeed(const std::string& uri, FeedOptions options)
    : CameraFeed(open_source(uri, options.schemes), options,
                 [uri, schemes = options.schemes] { return open_source(uri, schemes); }) {}

CameraFeed::CameraFeed(std::unique_ptr<Source> source, FeedOptions options, Open open) {
  if (!source) throw Error("camera", "there is no source", "give an open one");
  info_ = source->info();
  worker_ = std::make_shared<Worker>(std::move(source), std::move(options), std::move(open));
}

CameraFeed::~CameraFeed() { stop(); }

std::optional<Frame> CameraFeed::first_frame(double timeout) {
  return worker_->first_frame(timeout);
}

void CameraFeed::start(Sink sink, Hand hand) {
  if (thread_.joinable()) return;
  worker_->connect(std::move(sink), std::move(hand));
  thread_ = std::thread([worker = worker_] { worker->run(); });
}

void CameraFeed::request_stop() noexcept { worker_->request_stop(); }

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
  check_range("playback", "speed", "-", Playback::slowest, Playback::fastest, playback.speed);
  worker_->set_playback(playback);
}

void CameraFeed::seek(double share) {
  if (!(share >= 0.0 && share <= 1.0))
    throw Error("playback", "there is no position " + number_text(share) + " in a recording",
                "give 0, its beginning, to 1, its end");
  worker_->seek(share);
}

CameraStatus CameraFeed::status() const { return worker_->status(); }

}  // namespace palpate
