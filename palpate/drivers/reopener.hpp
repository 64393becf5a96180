// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cerrno>
#include <cmath>
#include <condition_variable>
#include <ctime>
#include <functional>
#include <mutex>
#include <thread>

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

/// Lets one thread at a time call a driver whose functions may hang. Nobody waits unless told to.
class DriverCalls {
 public:
  /// Holds the driver from construction on, if nobody else did.
  class Turn {
   public:
    explicit Turn(DriverCalls& calls) noexcept
        : calls_(calls), has_(!calls.busy_.test_and_set(std::memory_order_acquire)) {}
    ~Turn() {
      if (has_) calls_.busy_.clear(std::memory_order_release);
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    explicit operator bool() const noexcept { return has_; }

   private:
    DriverCalls& calls_;
    bool has_;
  };

  /// Calls `work` when nobody else calls the driver; waits up to `timeout` [s] for that.
  /// @return false if it could not
  bool call(double timeout, const std::function<void()>& work);

 private:
  std::atomic_flag busy_;
};

/// Opens a device that was unplugged again, on a thread of its own that sleeps until it is asked.
class Reopener {
 public:
  /// @param attempt   opens the device; true if it could. Must not throw
  /// @param interval  [s] between two attempts
  explicit Reopener(std::function<bool()> attempt, double interval = 0.25);
  /// Ends after an attempt that is under way.
  ~Reopener();

  /// The device is gone: attempts begin. [servo]
  void ask() noexcept;
  /// True from `ask` until an attempt has succeeded. [servo]
  [[nodiscard]] bool is_lost() const noexcept { return lost_.load(std::memory_order_acquire); }

 private:
  void run();

  std::function<bool()> attempt_;
  double interval_;  // [s]
  std::atomic<bool> lost_{false};
  WakeUp asked_;
  std::mutex mutex_;  // of ending_; the servo never takes it
  std::condition_variable wakes_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace palpate
