// SPDX-License-Identifier: Apache-2.0
#include "app/signals.hpp"

#include <ctime>
#include <initializer_list>
#include <utility>

#include <unistd.h>

namespace palpate::app {
namespace {

constexpr std::initializer_list<int> ending = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP};

}  // namespace

EndingSignals::EndingSignals(std::function<void()> on_signal) {
  sigemptyset(&set_);
  for (const int signal : ending) sigaddset(&set_, signal);
  sigaddset(&set_, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &set_, &before_);
  sigdelset(&set_, SIGPIPE);  // blocked, and never waited for: writes to a closed pipe just fail
  thread_ = std::thread([this, call = std::move(on_signal)] { wait(call); });
}

EndingSignals::~EndingSignals() {
  ending_ = true;
  thread_.join();
  sigaddset(&set_, SIGPIPE);
  const timespec none{};
  sigset_t pipe{};
  sigemptyset(&pipe);
  sigaddset(&pipe, SIGPIPE);
  while (sigtimedwait(&pipe, nullptr, &none) > 0) {
  }
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

void EndingSignals::wait(const std::function<void()>& on_signal) {
  bool called = false;
  while (!ending_) {
    const timespec timeout{.tv_sec = 0, .tv_nsec = 50'000'000};
    const int signal = sigtimedwait(&set_, nullptr, &timeout);
    if (signal <= 0) continue;
    if (std::exchange(called, true)) _exit(128 + signal);  // the force is off by now
    on_signal();
  }
}

}  // namespace palpate::app
