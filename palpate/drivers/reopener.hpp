// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <ctime>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

#include <semaphore.h>

#include "palpate/servo/realtime.hpp"

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

/// Does `work` under a lock that nobody else waits for: of a driver whose functions may hang, which
/// one thread at a time calls. Tries for up to `timeout` [s]. @return false if it could not
template <class Work>
bool call_when_free(std::mutex& calls, double timeout, const Work& work) {
  for (const double end = monotonic_now() + timeout;;) {
    if (const std::unique_lock turn(calls, std::try_to_lock); turn) {
      work();
      return true;
    }
    if (monotonic_now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
}

/// Opens a device that was unplugged again, on a thread of its own that sleeps until it is asked.
class Reopener {
 public:
  /// @param attempt  opens the device; true if it could. Must not throw
  explicit Reopener(std::function<bool()> attempt)
      : attempt_(std::move(attempt)), thread_(&Reopener::run, this) {}
  /// Ends after an attempt that is under way.
  ~Reopener() {
    ending_.store(true, std::memory_order_release);
    wakes_.call();
    thread_.join();
  }

  /// The device is gone: attempts begin. [servo]
  void ask() noexcept {
    if (!lost_.exchange(true, std::memory_order_acq_rel)) wakes_.call();
  }
  /// True from `ask` until an attempt has succeeded. [servo]
  [[nodiscard]] bool is_lost() const noexcept { return lost_.load(std::memory_order_acquire); }

 private:
  static constexpr double interval = 0.25;  // [s] between two attempts

  void run() {
    while (!ending_.load(std::memory_order_acquire)) {
      if (!is_lost()) {
        wakes_.wait();
        continue;
      }
      wakes_.wait(interval);
      if (!ending_.load(std::memory_order_acquire) && attempt_())
        lost_.store(false, std::memory_order_release);
    }
  }

  std::function<bool()> attempt_;
  std::atomic<bool> lost_{false};
  std::atomic<bool> ending_{false};
  WakeUp wakes_;  // it is lost, or all ends
  std::thread thread_;
};

}  // namespace palpate
