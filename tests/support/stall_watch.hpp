// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

namespace palpate::test {

/// Notices that the machine stands still: a thread that asks to be woken each millisecond, and
/// keeps how late it was at the worst.
class StallWatch {
 public:
  StallWatch()
      : thread_([this] {
          auto last = Clock::now();
          while (!ends_) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            const auto now = Clock::now();
            longest_ = std::max(longest_.load(), std::chrono::duration<double>(now - last).count());
            last = now;
          }
        }) {}
  ~StallWatch() {
    ends_ = true;
    thread_.join();
  }
  StallWatch(const StallWatch&) = delete;
  StallWatch& operator=(const StallWatch&) = delete;

  /// [s] for which the thread was not woken, at most
  [[nodiscard]] double longest() const { return longest_; }

 private:
  using Clock = std::chrono::steady_clock;
  std::atomic<double> longest_{0.0};
  std::atomic<bool> ends_{false};
  std::thread thread_;  // last: it uses the others
};

}  // namespace palpate::test
