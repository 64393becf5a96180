// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

namespace palpate {

/// Asks a thread to end, once. Any thread may give and see it; not for the servo's, as it locks.
class EndSignal {
 public:
  void give() noexcept {
    {
      const std::lock_guard lock(mutex_);
      given_ = true;
    }
    changed_.notify_all();
  }
  /// Waits until it is given, for `duration` at most. @return whether it was given
  template <class Duration>
  bool rest(const Duration& duration) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, duration, [this] { return given_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool given_ = false;
};

}  // namespace palpate
