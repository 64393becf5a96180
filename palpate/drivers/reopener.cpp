// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/reopener.hpp"

#include <chrono>
#include <utility>

#include "palpate/servo/realtime.hpp"

namespace palpate {

bool DriverCalls::call(double timeout, const std::function<void()>& work) {
  for (const double end = monotonic_now() + timeout;;) {
    if (const Turn turn(*this); turn) {
      work();
      return true;
    }
    if (monotonic_now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
}

Reopener::Reopener(std::function<bool()> attempt, double interval)
    : attempt_(std::move(attempt)), interval_(interval), thread_(&Reopener::run, this) {}

Reopener::~Reopener() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  wakes_.notify_all();
  asked_.call();
  thread_.join();
}

void Reopener::ask() noexcept {
  if (!lost_.exchange(true, std::memory_order_acq_rel)) asked_.call();
}

void Reopener::run() {
  for (;;) {
    asked_.wait();
    std::unique_lock lock(mutex_);
    while (!wakes_.wait_for(lock, std::chrono::duration<double>(interval_),
                            [this] { return ending_; })) {
      lock.unlock();
      const bool opened = attempt_();
      lock.lock();
      if (!opened) continue;
      lost_.store(false, std::memory_order_release);
      break;
    }
    if (ending_) return;
  }
}

}  // namespace palpate
