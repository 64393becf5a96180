// SPDX-License-Identifier: Apache-2.0
#include "app/live_camera.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate::app {
namespace {

constexpr double still_interval = 1.0 / 30.0;  // [s] at which an only frame is shown again
constexpr double longest_lag = 0.1;            // [s] beyond which the pace starts anew
constexpr int most_failures = 10;              // in a row

}  // namespace

LiveCamera::LiveCamera(std::string uri) : uri_(std::move(uri)), source_(open_source(uri_)) {
  std::optional<Frame> first = source_->next();
  if (!first) throw Error(uri_, "it has no frames", "give a source with at least one");
  first_ = std::move(*first);
  status_.uri = uri_;
  status_.kind = source_->info().kind;
  status_.rate = source_->info().frame_rate.value_or(0.0);
}

LiveCamera::~LiveCamera() {
  stop();
}

void LiveCamera::start(Sink sink) {
  thread_ = std::thread([this, sink = std::move(sink)] { run(sink); });
}

void LiveCamera::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

CameraStatus LiveCamera::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

// False if the camera is to stop.
bool LiveCamera::wait_until(double t) {
  std::unique_lock lock(mutex_);
  const std::chrono::duration<double> left(std::max(t - monotonic_now(), 0.0));
  changed_.wait_for(lock, left, [this] { return stopping_; });
  return !stopping_;
}

// The frame after the last; of a source that has ended, the first again.
std::optional<Frame> LiveCamera::next_frame() {
  std::string trouble;
  for (int failures = 0; failures < most_failures; ++failures) {
    try {
      if (auto frame = source_->next()) {
        ++frames_;
        return frame;
      }
      if (frames_ == 1) return std::nullopt;
      source_ = open_source(uri_);
      frames_ = 0;
    } catch (const Error& error) {
      trouble = error.what();
    }
  }
  const std::lock_guard lock(mutex_);
  status_.state = trouble.empty() ? "it has no frames any more" : trouble;
  return std::nullopt;
}

void LiveCamera::run(const Sink& sink) {
  Frame frame = first_;
  double offset = monotonic_now() - frame.stamp;  // from the source's clock to the loop's
  double last = 0.0;
  bool is_new = true;
  for (;;) {
    double due = is_new ? frame.stamp + offset : last + still_interval;
    const double now = monotonic_now();
    // Too slow a source, or stamps that jump: the pace starts anew rather than to catch up.
    if (is_new && (now - due > longest_lag || due - now > 1.0)) {
      due = std::max(now, last + 1e-3);
      offset = due - frame.stamp;
    }
    if (!wait_until(due)) return;
    sink({due, frame.cloud}, is_new);
    if (last > 0.0 && is_new && due > last) {
      const std::lock_guard lock(mutex_);
      status_.rate += 0.1 * (1.0 / (due - last) - status_.rate);
    }
    last = due;
    if (!is_new) continue;
    if (auto next = next_frame()) {
      if (frames_ == 1) offset = last + still_interval - next->stamp;  // it has begun again
      frame = std::move(*next);
    } else {
      const std::lock_guard lock(mutex_);
      if (status_.state != "live") return;  // no frame any more: the safety chain lets the hand go
      status_.kind += ", one frame";
      is_new = false;
    }
  }
}

}  // namespace palpate::app
