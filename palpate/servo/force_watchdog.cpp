// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/force_watchdog.hpp"

#include "palpate/kernel/core/error.hpp"

namespace palpate {

// Hazard: hang
void ForceWatchdog::look(double now) {
  const bool force_out = force_out_.load(std::memory_order_relaxed);
  const bool stalled = silence(now) > (force_out ? limits_.force_time : limits_.watch_time);
  if (stalled && !disabled_) {
    device_.disable();
    disabled_ = true;
  } else if (!stalled && disabled_ && now >= next_attempt_) {
    std::string refusal;
    try {
      device_.enable();
      disabled_ = false;
    } catch (const Error& error) {
      refusal = error.what();
      next_attempt_ = now + limits_.retry_time;
    }
    const std::lock_guard lock(mutex_);
    refusal_ = std::move(refusal);
  }
}

std::string ForceWatchdog::refusal() const {
  const std::lock_guard lock(mutex_);
  return refusal_;
}

}  // namespace palpate
