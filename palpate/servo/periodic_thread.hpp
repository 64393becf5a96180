// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <future>
#include <thread>

#include "palpate/servo/histogram.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {

/// How well a thread keeps its deadlines. One thread writes, any may look.
struct Timing {
  Histogram wake_up;                         ///< [ns] from a deadline until the thread ran
  Histogram compute;                         ///< [ns] of a cycle, by the thread's own CPU clock
  std::atomic<std::uint64_t> late_ticks{0};  ///< not done when the next was due
  std::atomic<std::uint64_t> late_by_compute{0};       ///< of them: the cycle's own work
  std::atomic<std::uint64_t> late_by_interruption{0};  ///< of them: other work on the core
  // The rest of them were woken late, or called late by the device.

  /// Counts a late tick by its cause. [servo]
  /// @param began_late  it was late before its cycle began
  /// @param cpu, whole  [ns] of the cycle: of the thread's CPU time, and as time passed
  void add_late(bool began_late, std::uint64_t cpu, std::uint64_t whole) noexcept;
};

/// When a cycle runs, and how the last ones kept their time.
struct Wake {
  double t = 0.0;                         ///< [s] now
  std::uint32_t wake_up_ns = 0;           ///< [ns] after its deadline
  std::uint32_t previous_compute_ns = 0;  ///< [ns] CPU time of the cycle before
};

/// Calls a function at a fixed rate on a thread of its own, by absolute deadlines.
///
/// A cycle that is late does not shift the ones after it. Deadlines that have passed meanwhile are
/// skipped and counted: a burst of ticks to make up for them would be worse than the gap.
class PeriodicThread {
 public:
  /// Starts at once and returns when the thread has its rights.
  /// @param rate   [Hz] 1 to 10 000
  /// @param cycle  [servo] called with the time by monotonic_now(); must not throw
  /// @param last   [servo] called once on the same thread after the last cycle, if it is set
  /// @throws Error if the rate is out of range.
  PeriodicThread(double rate, const RealtimeRequest& request,
                 std::function<void(const Wake&)> cycle, std::function<void()> last = {});
  /// Stops after the cycle in progress.
  ~PeriodicThread();

  /// The same, and keeps the timing. Not from within a cycle.
  void stop();
  /// Asks the thread to stop after the cycle in progress, and returns at once.
  void request_stop() noexcept { stopping_.store(true, std::memory_order_relaxed); }
  /// Asks the thread to stop and waits, at most `timeout` [s], until `last` has been called.
  /// @return false if it has not: the cycle in progress hangs
  bool try_stop(double timeout);

  [[nodiscard]] const RealtimeReport& realtime() const { return report_; }
  [[nodiscard]] const Timing& timing() const { return timing_; }

 private:
  void run(std::uint64_t period, const RealtimeRequest& request,
           std::promise<RealtimeReport> started);

  std::function<void(const Wake&)> cycle_;
  std::function<void()> last_;
  std::promise<void> ending_;
  std::future<void> ended_;
  Timing timing_;
  std::atomic<bool> stopping_{false};
  RealtimeReport report_;
  std::thread thread_;
};

}  // namespace palpate
