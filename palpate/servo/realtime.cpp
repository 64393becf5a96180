// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/realtime.hpp"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <limits>

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

namespace palpate {
namespace {

bool may_lock_all_that_is_to_come() {
  // With a finite limit MCL_FUTURE makes some later allocation of the process fail.
  rlimit limit{};
  return geteuid() == 0 ||
         (getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY);
}

// Touches the stack that ticks will use, so that it is there before the first.
void touch_stack() {
  std::array<volatile char, 256 * 1024> stack;
  for (std::size_t i = 0; i < stack.size(); i += 1024) stack[i] = 0;
}

// The last but `skipped` of those that the thread may use, in turn where these are fewer.
int core_from_the_end(unsigned skipped) {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (pthread_getaffinity_np(pthread_self(), sizeof(allowed), &allowed) != 0) return -1;
  const int cores = CPU_COUNT(&allowed);
  if (cores < 1) return -1;
  int left = static_cast<int>(skipped % static_cast<unsigned>(cores));
  for (int core = CPU_SETSIZE - 1; core >= 0; --core) {
    if (CPU_ISSET(core, &allowed) && left-- == 0) return core;
  }
  return -1;
}

bool pin_to(int core) {
  if (core < 0) return false;
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(core, &set);
  return pthread_setaffinity_np(pthread_self(), sizeof(set), &set) == 0;
}

}  // namespace

RealtimeThread::RealtimeThread(const RealtimeRequest& request) {
  prctl(PR_SET_TIMERSLACK, 1UL);  // without SCHED_FIFO the kernel may add 50 us to each sleep
  if (!request.enabled) return;

  const sched_param param{.sched_priority = request.priority};
  report_.fifo = pthread_setschedparam(pthread_self(), SCHED_FIFO, &param) == 0;
  if (report_.fifo) {
    report_.priority = request.priority;
  } else {
    report_.advice.emplace_back(
        "SCHED_FIFO was refused: add '@realtime - rtprio 95' to /etc/security/limits.d/"
        "realtime.conf, put yourself in the group 'realtime' and log in again");
  }

  // No page is to be fetched from disk in a tick.
  report_.locked = may_lock_all_that_is_to_come() && mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  touch_stack();
  if (!report_.locked) {
    report_.advice.emplace_back(
        "locking memory was refused: add '@realtime - memlock unlimited' to "
        "/etc/security/limits.d/realtime.conf, put yourself in the group 'realtime' and log in "
        "again");
  }

  if (request.pin) {
    const int core = core_from_the_end(request.core);
    if (pin_to(core)) {
      report_.core = core;
    } else {
      report_.advice.emplace_back("pinning to a core was refused: start it without a cpuset");
    }
  }

  latency_file_ = open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
  const std::int32_t no_latency = 0;
  report_.awake = latency_file_ >= 0 &&
                  write(latency_file_, &no_latency, sizeof(no_latency)) == sizeof(no_latency);
  if (!report_.awake) {
    report_.advice.emplace_back(
        "cores may sleep deeply between ticks: make /dev/cpu_dma_latency writable, or boot with "
        "'cpuidle.off=1'");
  }
}

RealtimeThread::~RealtimeThread() {
  if (latency_file_ >= 0) close(latency_file_);
}

std::int64_t since_1970(double monotonic) noexcept {
  constexpr int most_looks = 8;
  constexpr double quick = 20e-6;  // [s]
  double least = std::numeric_limits<double>::infinity();
  std::int64_t time = 0;
  for (int i = 0; i < most_looks && least > quick; ++i) {
    timespec wall{};
    const double before = monotonic_now();
    clock_gettime(CLOCK_REALTIME, &wall);
    const double after = monotonic_now();
    if (after - before >= least) continue;
    least = after - before;
    time = std::int64_t{1'000'000'000} * wall.tv_sec + wall.tv_nsec -
           std::llround(1e9 * (0.5 * (before + after) - monotonic));
  }
  return time;
}

double monotonic_now() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void sleep_until(std::uint64_t deadline) noexcept {
  constexpr std::uint64_t second = 1'000'000'000;  // [ns]
  const timespec at{.tv_sec = static_cast<time_t>(deadline / second),
                    .tv_nsec = static_cast<long>(deadline % second)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr) == EINTR) {
  }
}

}  // namespace palpate
