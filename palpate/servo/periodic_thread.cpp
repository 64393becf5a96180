// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/periodic_thread.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>
#include <utility>

#include "palpate/kernel/core/parameters.hpp"

namespace palpate {
namespace {

constexpr std::uint64_t second = 1'000'000'000;  // [ns]

std::uint64_t nanoseconds(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * second + static_cast<std::uint64_t>(now.tv_nsec);
}

double seconds(std::uint64_t nanoseconds) noexcept {
  return 1e-9 * static_cast<double>(nanoseconds);
}

std::uint32_t clipped(std::uint64_t nanoseconds) noexcept {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(nanoseconds, std::numeric_limits<std::uint32_t>::max()));
}

}  // namespace

PeriodicThread::PeriodicThread(double rate, const RealtimeRequest& request,
                               std::function<void(const Wake&)> cycle, std::function<void()> last)
    : cycle_(std::move(cycle)), last_(std::move(last)), ended_(ending_.get_future()) {
  check_range("servo rate", "", "Hz", 1.0, 10'000.0, rate);
  const auto period = static_cast<std::uint64_t>(std::llround(1e9 / rate));
  std::promise<RealtimeReport> started;
  std::future<RealtimeReport> report = started.get_future();
  thread_ = std::thread(&PeriodicThread::run, this, period, request, std::move(started));
  report_ = report.get();
}

PeriodicThread::~PeriodicThread() { stop(); }

void PeriodicThread::stop() {
  request_stop();
  if (thread_.joinable()) thread_.join();
}

bool PeriodicThread::try_stop(double timeout) {
  request_stop();
  return ended_.wait_for(std::chrono::duration<double>(timeout)) == std::future_status::ready;
}

void Timing::add_late(bool began_late, std::uint64_t cpu, std::uint64_t whole) noexcept {
  const auto count = [](auto& number) { number.fetch_add(1, std::memory_order_relaxed); };
  count(late_ticks);
  if (!began_late) count(2 * cpu > whole ? late_by_compute : late_by_interruption);
}

void PeriodicThread::run(std::uint64_t period, const RealtimeRequest& request,
                         std::promise<RealtimeReport> started) {
  const RealtimeThread realtime(request);
  started.set_value(realtime.report());
  std::uint64_t deadline = nanoseconds(CLOCK_MONOTONIC) + period;
  std::uint64_t compute = 0;
  while (!stopping_.load(std::memory_order_relaxed)) {
    sleep_until(deadline);
    const std::uint64_t awake = nanoseconds(CLOCK_MONOTONIC);
    const std::uint64_t cpu = nanoseconds(CLOCK_THREAD_CPUTIME_ID);
    cycle_({seconds(awake), clipped(awake - deadline), clipped(compute)});
    compute = nanoseconds(CLOCK_THREAD_CPUTIME_ID) - cpu;
    timing_.compute.add(compute);
    timing_.wake_up.add(awake - deadline);
    deadline += period;
    const std::uint64_t done = nanoseconds(CLOCK_MONOTONIC);
    if (done > deadline) {
      timing_.add_late(awake + period - deadline > done - awake, compute, done - awake);
      deadline += ((done - deadline) / period + 1) * period;
    }
  }
  if (last_) last_();
  ending_.set_value();
}

}  // namespace palpate
