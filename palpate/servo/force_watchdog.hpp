// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <mutex>
#include <string>

#include "palpate/servo/device.hpp"

namespace palpate {

/// Takes the force off a device whose servo cycles do not come any more.
///
/// Method and safety chain run on one thread: while a method hangs, the device holds the force that
/// was sent last. This judges from another thread. Its verdicts follow from the times that it is
/// given; ServoLoop owns the thread that looks at it, above the servo's priority where it may.
class ForceWatchdog {
 public:
  struct Limits {
    double force_time = 0.010;  ///< [s] without a tick while a force is out: the device is disabled
    double watch_time = 0.025;  ///< [s] the same while none is out
    double retry_time = 1.0;    ///< [s] after the device refused to be enabled again
  };

  explicit ForceWatchdog(Device& device) : ForceWatchdog(device, Limits()) {}
  /// @param device  must outlive this
  ForceWatchdog(Device& device, const Limits& limits) : device_(device), limits_(limits) {}

  /// A tick begins. [servo]
  /// @param now        [s]
  /// @param force_out  the tick before sent a force other than zero
  void beat(double now, bool force_out) noexcept {
    force_out_.store(force_out, std::memory_order_relaxed);
    last_beat_.store(now, std::memory_order_relaxed);
  }

  /// Disables the device if the ticks have stopped, and enables it if they have come again. May
  /// wait as Device::enable does, but never before it has disabled. One thread, not the servo's.
  void look(double now);

  /// [s] since the last tick began. Any thread.
  [[nodiscard]] double silence(double now) const noexcept {
    return now - last_beat_.load(std::memory_order_relaxed);
  }
  /// Why the device could not be enabled again; empty if it could. Any thread but the servo's.
  [[nodiscard]] std::string refusal() const;

 private:
  Device& device_;
  Limits limits_;
  std::atomic<double> last_beat_{0.0};  // [s]
  std::atomic<bool> force_out_{false};
  // Of the thread that looks:
  bool disabled_ = false;
  double next_attempt_ = 0.0;  // [s]
  mutable std::mutex mutex_;   // of refusal_; the servo never takes it
  std::string refusal_;
};

}  // namespace palpate
