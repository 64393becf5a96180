// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace palpate {

/// What a real-time thread asks the operating system for.
struct RealtimeRequest {
  bool enabled = true;  ///< false asks for nothing: for tests and for free-running work
  int priority = 80;    ///< SCHED_FIFO, 1 to 99; above the kernel's interrupt threads' 50
  bool pin = true;      ///< pin the thread to one core of the process's affinity mask
  unsigned core = 0;    ///< index of that core counted from the last (0), modulo their number
};

/// What was granted, and what to do about the rest.
struct RealtimeReport {
  bool fifo = false;    ///< scheduled before everything that is not real-time
  int priority = 0;     ///< SCHED_FIFO priority, 0 if not granted
  bool locked = false;  ///< memory stays in RAM
  int core = -1;        ///< the core it is pinned to, -1 if none
  bool awake = false;   ///< cores are kept out of deep sleep while the thread runs
  /// For each thing that was asked for and refused: what is missing and how to get it.
  std::vector<std::string> advice;
};

/// Makes the calling thread real-time as far as the system lets it.
///
/// Locking memory concerns the whole process and stays. Files and allocations: not for a tick.
class RealtimeThread {
 public:
  explicit RealtimeThread(const RealtimeRequest& request);
  /// Lets the cores sleep again; the thread keeps its scheduling.
  ~RealtimeThread();
  RealtimeThread(const RealtimeThread&) = delete;
  RealtimeThread& operator=(const RealtimeThread&) = delete;

  [[nodiscard]] const RealtimeReport& report() const { return report_; }

 private:
  RealtimeReport report_;
  int latency_file_ = -1;  // /dev/cpu_dma_latency counts while it is open
};

/// Seconds on CLOCK_MONOTONIC: the clock of the servo loop and of live frames' stamps. [servo]
double monotonic_now() noexcept;
/// CLOCK_REALTIME at that time on CLOCK_MONOTONIC [ns since 1970]. A thread that loses the
/// processor between its looks at two clocks is wrong by as long: the quickest of several looks
/// counts.
std::int64_t since_1970(double monotonic) noexcept;
/// Sleeps until then on the same clock. @param deadline [ns]
void sleep_until(std::uint64_t deadline) noexcept;

}  // namespace palpate
