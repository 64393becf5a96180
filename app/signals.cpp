// SPDX-License-Identifier: Apache-2.0
#include "app/signals.hpp"

#include <cstddef>
#include <ctime>
#include <initializer_list>
#include <utility>

#include <unistd.h>

namespace palpate::app {
namespace {

constexpr std::initializer_list<int> ending = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP};

constexpr std::array interrupting = {SIGINT, SIGTERM, SIGHUP};
std::atomic<int> interrupted_by{0};
static_assert(std::atomic<int>::is_always_lock_free);

extern "C" void note_interruption(int signal) {
  int none = 0;
  interrupted_by.compare_exchange_strong(none, signal);
}

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
    if (std::exchange(called, true)) _exit(exit_status_of(signal));  // the force is off by now
    on_signal();
  }
}

Interruption::Interruption() {
  interrupted_by = 0;
  for (std::size_t i = 0; i < interrupting.size(); ++i) {
    struct sigaction action {};
    action.sa_handler = note_interruption;
    action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
    sigaction(interrupting[i], nullptr, &before_[i]);
    if (before_[i].sa_handler != SIG_IGN) sigaction(interrupting[i], &action, nullptr);
  }
}

Interruption::~Interruption() {
  for (std::size_t i = 0; i < interrupting.size(); ++i)
    sigaction(interrupting[i], &before_[i], nullptr);
}

int Interruption::signal() const noexcept { return interrupted_by; }

}  // namespace palpate::app
