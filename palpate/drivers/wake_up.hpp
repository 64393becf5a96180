// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <cmath>
#include <ctime>

#include <semaphore.h>

namespace palpate {

/// Wakes one thread that waits; the one that wakes it never waits. (std::counting_semaphore can
/// sleep for ever in libstdc++ 12, GCC's bug 104928.)
class WakeUp {
 public:
  WakeUp() noexcept { sem_init(&semaphore_, 0, 0); }
  ~WakeUp() { sem_destroy(&semaphore_); }
  WakeUp(const WakeUp&) = delete;
  WakeUp& operator=(const WakeUp&) = delete;

  void call() noexcept { sem_post(&semaphore_); }
  /// Waits for a call; the calls until it returns count as one.
  void wait() noexcept {
    while (sem_wait(&semaphore_) != 0 && errno == EINTR) {
    }
    take_all();
  }
  /// As `wait`, for up to `timeout` [s].
  void wait(double timeout) noexcept {
    timespec end{};
    clock_gettime(CLOCK_MONOTONIC, &end);
    const double whole = std::floor(timeout);
    end.tv_sec += static_cast<time_t>(whole);
    end.tv_nsec += static_cast<long>(1e9 * (timeout - whole));
    if (end.tv_nsec >= 1'000'000'000) {
      end.tv_nsec -= 1'000'000'000;
      ++end.tv_sec;
    }
    while (sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &end) != 0 && errno == EINTR) {
    }
    take_all();
  }

 private:
  void take_all() noexcept {
    while (sem_trywait(&semaphore_) == 0) {
    }
  }
  sem_t semaphore_{};
};

}  // namespace palpate
