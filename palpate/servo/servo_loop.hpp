// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "palpate/servo/cycle.hpp"
#include "palpate/servo/end_signal.hpp"
#include "palpate/servo/force_watchdog.hpp"
#include "palpate/servo/periodic_thread.hpp"

namespace palpate {

/// How the loop runs.
struct ServoOptions {
  /// [Hz] 500 to 10 000; a clean wall grows stiffer with it. A device that drives the loop has its
  /// own rate: then this is what lateness is measured against if the device does not say its rate.
  double rate = 1000.0;
  RealtimeRequest realtime{};
  /// [s] 0.005 to 1: without a tick for so long the device is disabled; while a force is out, after
  /// ForceWatchdog::Limits::force_time or this, whichever is shorter.
  double watch_time = 0.025;
};

/// The live loop: cycles on a real-time thread of their own, or on the thread of a device that
/// drives them, from `start` to `stop`.
///
/// Time is monotonic_now(): frames must be stamped on that clock. A second thread, of a higher
/// priority where it may, watches the ticks (ForceWatchdog): when none comes for 10 ms while a
/// force is out, because a cycle hangs or the device's callback has ended, it disables the device,
/// and enables it again when ticks come again; the safety chain then lets the force rise slowly.
class ServoLoop {
 public:
  /// @throws Error if the rate or watch time is out of range or the settings do not validate.
  ServoLoop(std::shared_ptr<Method> method, Device& device, const ServoSettings& settings = {},
            const ServoOptions& options = {});
  /// Stops, and waits for a cycle that hangs, however long it does: the device is disabled by then,
  /// and what the cycle uses must live until it returns.
  ~ServoLoop();

  /// Enables the device and starts the ticks, once; returns when the thread has its rights or the
  /// device's first callback has come.
  /// @throws Error if the device cannot be enabled or started, or its callback does not come.
  void start();
  /// Sets the force to zero, then stops the loop. The servo thread writes a zero force as its last
  /// action; if this does not happen within 50 ms, the calling thread continues without it. In both
  /// cases the device is then disabled and the threads end. A cycle that hangs, in the method or
  /// the driver, is waited for 1 s at most. A concurrent second call only disables the device,
  /// immediately. Any thread except the servo thread.
  /// @return false if a cycle (or Device::enable) hangs: its thread continues until that
  ///         returns and then ends; the device stays disabled. Destroying this waits for it
  bool stop();
  /// Requests the servo thread to end with a zero force, and returns at once: with several loops,
  /// no hand waits for another. `stop` has to follow. Any thread.
  void request_stop() noexcept;
  /// Has `stop` returned true? Any thread.
  [[nodiscard]] bool has_ended() const noexcept { return ended_.load(std::memory_order_acquire); }

  /// What runs in each tick; alive from construction to destruction.
  [[nodiscard]] Cycle& cycle() { return cycle_; }
  [[nodiscard]] const CycleStatistics& statistics() const { return cycle_.statistics(); }

  /// Of the thread that ticks; empty before `start`, kept after `stop`. On a device's thread the
  /// wake-up time is how much longer than a period the time since the last tick was.
  [[nodiscard]] const Timing& timing() const {
    return thread_ ? thread_->timing() : driven_timing_;
  }
  [[nodiscard]] const RealtimeReport& realtime() const {
    return thread_ ? thread_->realtime() : driven_report_;
  }
  /// [Hz] of the ticks: the options', or that of a device that drives them.
  [[nodiscard]] double rate() const { return rate_; }
  /// Why the device gives no force and what to do; empty if it is well. Any thread but the servo's.
  [[nodiscard]] std::string trouble() const;

 private:
  void driven_tick() noexcept;
  void start_driven();
  void beat(double now) noexcept;
  void watch();
  void finish();

  Device& device_;
  ServoOptions options_;
  double rate_;
  Cycle cycle_;
  std::atomic<bool> started_{false};
  std::atomic<bool> stopped_{false};
  std::atomic<bool> ended_{false};          // all threads have
  std::atomic<bool> hangs_{false};          // a thread, when it was to stop
  std::unique_ptr<PeriodicThread> thread_;  // null if the device drives

  // Of a device that drives: its thread's, but for the atomics.
  Timing driven_timing_;
  RealtimeReport driven_report_;
  std::atomic<bool> first_tick_{false};
  std::atomic<bool> stopping_{false};
  std::atomic<bool> zero_sent_{false};  // after stopping_
  std::atomic<bool> in_callback_{false};
  double previous_tick_ = 0.0;          // [s]
  std::uint32_t previous_compute_ = 0;  // [ns]
  double previous_whole_ = 0.0;         // [s] of the cycle before, as time passed

  ForceWatchdog watchdog_;
  std::thread watch_;
  EndSignal watch_end_;
  std::atomic<bool> watch_has_ended_{false};
};

}  // namespace palpate
