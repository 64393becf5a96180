// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/servo_loop.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>
#include <string>
#include <utility>

#include <pthread.h>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr double last_write_time = 0.05;                       // [s] for the ticking thread to end
constexpr double hang_time = 1.0;                              // [s] for a cycle to return
constexpr double first_callback_time = 1.0;                    // [s] for a driver to begin
constexpr auto watch_interval = std::chrono::milliseconds(2);  // a fifth of the shortest limit
constexpr int watch_priority = 5;                              // above the servo's

std::uint64_t thread_cpu_time() noexcept {  // [ns]
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000U +
         static_cast<std::uint64_t>(now.tv_nsec);
}

// Waits until `done()` or for `timeout` [s].
template <class Condition>
bool wait_for(double timeout, const Condition& done) {
  const double end = monotonic_now() + timeout;
  while (!done()) {
    if (monotonic_now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

}  // namespace

ServoLoop::ServoLoop(std::shared_ptr<Method> method, Device& device, const ServoSettings& settings,
                     const ServoOptions& options)
    : device_(device),
      options_(options),
      rate_(device.drives() ? device.info().rate.value_or(options.rate) : options.rate),
      cycle_(std::move(method), device, settings),
      watchdog_(device,
                {.force_time = std::min(ForceWatchdog::Limits().force_time, options.watch_time),
                 .watch_time = options.watch_time}) {
  check_range("servo rate", "", "Hz", 500.0, 10'000.0, options_.rate);
  check_range("watch time", "", "s", 0.005, 1.0, options_.watch_time);
}

ServoLoop::~ServoLoop() {
  stop();
  if (started_ && !ended_) finish();
}

void ServoLoop::start() {
  if (started_) return;
  device_.enable();
  watchdog_.beat(monotonic_now(), false);
  if (device_.drives()) {
    start_driven();
  } else {
    thread_ = std::make_unique<PeriodicThread>(
        options_.rate, options_.realtime,
        [this](const Wake& wake) {
          beat(wake.t);
          cycle_.run(wake);
        },
        [this] { LastGate::write_zero(device_, monotonic_now()); });
  }
  started_ = true;
  watch_ = std::thread(&ServoLoop::watch, this);
}

void ServoLoop::start_driven() {
  const auto close = [this] {
    device_.stop();
    device_.disable();
  };
  try {
    device_.start([this] { driven_tick(); });
  } catch (...) {
    close();
    throw;
  }
  if (!wait_for(first_callback_time,
                [this] { return first_tick_.load(std::memory_order_acquire); })) {
    close();
    const std::string fault = device_.fault_text();
    throw Error(device_.info().uri, "its driver does not call the servo cycle",
                fault.empty() ? "switch the device off and on again" : fault);
  }
}

void ServoLoop::driven_tick() noexcept {
  struct Callback {
    std::atomic<bool>& in_progress;
    explicit Callback(std::atomic<bool>& flag) : in_progress(flag) {
      in_progress.store(true, std::memory_order_release);
    }
    ~Callback() { in_progress.store(false, std::memory_order_release); }
  } const callback(in_callback_);
  const double now = monotonic_now();
  beat(now);
  if (stopping_.load(std::memory_order_acquire)) {
    if (zero_sent_.load(std::memory_order_relaxed)) return;
    LastGate::write_zero(device_, now);
    zero_sent_.store(true, std::memory_order_release);
    return;
  }
  const double period = 1.0 / rate_;
  double late = 0.0;
  if (!first_tick_.load(std::memory_order_relaxed)) {
    int policy = 0;
    sched_param scheduling{};
    if (pthread_getschedparam(pthread_self(), &policy, &scheduling) == 0)
      driven_report_.fifo = policy == SCHED_FIFO || policy == SCHED_RR;
    if (driven_report_.fifo) driven_report_.priority = scheduling.sched_priority;
    first_tick_.store(true, std::memory_order_release);
  } else {
    late = std::clamp(now - previous_tick_ - period, 0.0, 4.0);
    driven_timing_.wake_up.add(static_cast<std::uint64_t>(1e9 * late));
    if (late > 0.5 * period)
      driven_timing_.add_late(previous_whole_ < period, previous_compute_,
                              static_cast<std::uint64_t>(1e9 * previous_whole_));
  }
  previous_tick_ = now;
  const std::uint64_t cpu = thread_cpu_time();
  cycle_.run({now, static_cast<std::uint32_t>(1e9 * late), previous_compute_});
  const std::uint64_t compute = thread_cpu_time() - cpu;
  driven_timing_.compute.add(compute);
  previous_compute_ = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(compute, std::numeric_limits<std::uint32_t>::max()));
  previous_whole_ = monotonic_now() - now;
}

void ServoLoop::beat(double now) noexcept {
  watchdog_.beat(now, statistics().force_out.load(std::memory_order_relaxed));
}

void ServoLoop::watch() {
  RealtimeRequest request = options_.realtime;
  request.priority = std::min(request.priority + watch_priority, 99);
  request.pin = false;  // the servo's core may be the one that hangs
  const RealtimeThread realtime(request);
  while (!watch_end_.rest(watch_interval)) watchdog_.look(monotonic_now());
  device_.disable();  // this thread may have enabled it after it was to end
  watch_has_ended_.store(true, std::memory_order_release);
}

void ServoLoop::request_stop() noexcept {
  if (!started_) return;
  stopping_.store(true, std::memory_order_release);
  if (thread_) thread_->request_stop();
}

// Hazard: session-stops, hanging-driver
bool ServoLoop::stop() {
  if (!started_) return true;
  if (stopped_.exchange(true)) {
    if (!ended_) device_.disable();
    return ended_;
  }
  request_stop();
  const bool sent =
      thread_ ? thread_->try_stop(last_write_time) : wait_for(last_write_time, [this] {
        return zero_sent_.load(std::memory_order_acquire);
      });
  device_.disable();
  watch_end_.give();
  const bool returns =
      wait_for(hang_time, [this] { return watch_has_ended_.load(std::memory_order_acquire); }) &&
      (sent || (thread_ ? thread_->try_stop(hang_time) : wait_for(hang_time, [this] {
         return !in_callback_.load(std::memory_order_acquire);
       })));
  hangs_ = !returns;
  if (returns) finish();
  return returns;
}

// Waits for all threads, as long as that takes.
void ServoLoop::finish() {
  if (watch_.joinable()) watch_.join();
  if (thread_) {
    thread_->stop();
  } else {
    device_.stop();
    if (!zero_sent_) LastGate::write_zero(device_, monotonic_now());
  }
  ended_.store(true, std::memory_order_release);
}

std::string ServoLoop::trouble() const {
  if (std::string text = device_.fault_text(); !text.empty()) return text;
  if (hangs_ && !ended_)
    return "the method or the device's driver has not returned from its last tick: the device is "
           "disabled, and that thread ends when it returns";
  const double silent = watchdog_.silence(monotonic_now());
  if (started_ && !stopped_ && silent > options_.watch_time)
    return "no tick for " + std::to_string(std::lround(1e3 * silent)) +
           " ms: the device is disabled until ticks resume";
  if (std::string text = watchdog_.refusal(); !text.empty()) return text;
  return std::string(describe(fault_of(statistics().hand.load(std::memory_order_relaxed))));
}

}  // namespace palpate
