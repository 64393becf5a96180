// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "palpate/drivers/wake_up.hpp"

namespace palpate {

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
  Reopener(const Reopener&) = delete;
  Reopener& operator=(const Reopener&) = delete;

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
