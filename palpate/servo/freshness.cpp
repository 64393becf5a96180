// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/freshness.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {
namespace {

// [s] A longer pause is an interruption and says nothing about the camera's rate.
constexpr double longest_interval = 1.0;
// [s] No depth camera is faster than 1 kHz; frames that arrive in a burst do not count as a rate.
constexpr double shortest_interval = 1e-3;

}  // namespace

void Freshness::Interval::add(double seconds) noexcept {
  last_[added_ % count] = std::max(seconds, shortest_interval);
  ++added_;
  const std::size_t n = std::min(added_, count);
  std::array<double, count> sorted;
  sorted.fill(std::numeric_limits<double>::infinity());
  std::copy_n(last_.begin(), n, sorted.begin());
  std::sort(sorted.begin(), sorted.end());  // of all: gcc 14 warns of an end that it cannot know
  usual_ = sorted[n / 2];
}

void Freshness::adopt(std::span<const CameraFrame> frames, double arrived,
                      double tolerance) noexcept {
  std::array<bool, max_cameras> listed{};
  for (const CameraFrame& frame : frames) {
    if (frame.camera >= max_cameras) continue;
    Camera& camera = cameras_[frame.camera];
    listed[frame.camera] = camera.expected = true;
    // Most stamps of other cameras are known; what is older than that was overtaken.
    const bool is_new = &frame == frames.data() ? frame.stamp != camera.last_stamp
                                                : frame.stamp > camera.last_stamp;
    if (!std::isfinite(frame.stamp) || !is_new) continue;
    const bool fresh = frame.stamp > camera.last_stamp && frame.stamp <= arrived + tolerance;
    if (fresh) {
      const double interval = frame.stamp - camera.last_stamp;
      if (camera.was_fresh && interval <= longest_interval) camera.interval.add(interval);
      camera.fresh_stamp = frame.stamp;
      camera.arrived = arrived;
      camera.ever_fresh = true;
    }
    camera.was_fresh = fresh;
    camera.last_stamp = frame.stamp;
  }
  for (std::size_t i = 0; i < max_cameras; ++i) {
    if (!listed[i]) cameras_[i] = {};
  }
}

// Hazard: lost-camera
Freshness::Age Freshness::at(double t) const noexcept {
  constexpr double inf = std::numeric_limits<double>::infinity();
  Age worst{0.0, 0.0};
  bool any = false;
  for (const Camera& camera : cameras_) {
    if (!camera.expected) continue;
    any = true;
    if (!camera.ever_fresh) return {inf, inf};
    const double since = t - camera.arrived;
    const double age = std::max(t - camera.fresh_stamp, since);
    const double intervals = since / camera.interval.usual();
    if (!(age <= worst.age)) worst.age = age;  // a NaN, too
    if (!(intervals <= worst.intervals)) worst.intervals = intervals;
  }
  return any ? worst : Age{inf, inf};
}

}  // namespace palpate
