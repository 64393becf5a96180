// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include "palpate/kernel/core/parameters.hpp"

namespace palpate {

/// Latency and interval of the newest eight frames: by these a slow or distant camera, whose frames
/// are as fresh as they can be, is distinguished from a stream that stopped.
///
/// [servo] Nothing here allocates, locks or throws.
class FrameTiming {
 public:
  /// What is older than `oldest` [s] when it comes is history, not a surface to touch.
  void set(double oldest) noexcept { oldest_ = oldest; }
  /// A frame captured at `stamp` [s] is in use; `interval` [s] after the one before, 0 if unknown.
  void frame(double stamp, double interval) noexcept {
    stamp_ = stamp;
    newest_ = (newest_ + 1) % remembered;
    latencies_[newest_] = none;
    intervals_[newest_] = interval > 0.0 ? interval : none;
    used_ = false;
  }
  /// A tick at `t` [s]: the first after a frame measures its latency.
  void tick(double t) noexcept {
    if (used_) return;
    used_ = true;
    latencies_[newest_] = std::max(t - stamp_, 0.0);
  }
  /// [s] since the newest frame would have come if it had been as punctual as the best of the last.
  [[nodiscard]] double age(double t) const noexcept { return t - stamp_ - latency(); }
  /// [s] the shortest of the last latencies, `oldest` at most.
  [[nodiscard]] double latency() const noexcept {
    return std::min(*std::min_element(latencies_.begin(), latencies_.end()), oldest_);
  }
  /// [s] the shortest of the last intervals, half of that at most: at less than 4 Hz a hand outruns
  /// what it is shown.
  [[nodiscard]] double interval() const noexcept {
    return std::min(*std::min_element(intervals_.begin(), intervals_.end()), 0.5 * oldest_);
  }

 private:
  static constexpr std::size_t remembered = 8;
  static constexpr double none = std::numeric_limits<double>::infinity();
  static constexpr std::array<double, remembered> nothing() noexcept {
    std::array<double, remembered> all{};
    for (double& each : all) each = none;
    return all;
  }

  double oldest_ = SightParameters().oldest_frame;
  double stamp_ = 0.0;
  std::array<double, remembered> latencies_ = nothing();
  std::array<double, remembered> intervals_ = nothing();
  std::size_t newest_ = 0;
  bool used_ = true;
};

}  // namespace palpate
