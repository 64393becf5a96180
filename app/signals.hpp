// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <csignal>
#include <functional>
#include <thread>

namespace palpate::app {

/// Signals that end a session, waited for on a thread of their own from construction on: SIGINT,
/// SIGTERM, SIGHUP and SIGQUIT. SIGPIPE and SIGTSTP are kept from ending or stopping the process
/// with a force on: the first is ignored, the second ends the session as the others do. Threads
/// that begin before this see the signals as before.
class EndingSignals {
 public:
  /// @param on_signal  called once, on that thread; a second signal ends the process at once
  explicit EndingSignals(std::function<void()> on_signal);
  ~EndingSignals();
  EndingSignals(const EndingSignals&) = delete;
  EndingSignals& operator=(const EndingSignals&) = delete;

 private:
  void wait(const std::function<void()>& on_signal);

  sigset_t set_{}, before_{};
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

/// SIGINT, SIGTERM and SIGHUP noted instead of ending a program that has something to finish; a
/// second one of a kind ends it at once. Those that were ignored before stay so, as in the
/// background of a shell. For work without a force: all else is as usual. One at a time.
class Interruption {
 public:
  Interruption();
  ~Interruption();
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  /// The signal that came first, 0 before. Of no lock; each call looks again.
  [[nodiscard]] int signal() const noexcept;

 private:
  std::array<struct sigaction, 3> before_{};
};

/// The exit status of a program that a signal ended, as shells give it.
constexpr int exit_status_of(int signal) noexcept { return 128 + signal; }

}  // namespace palpate::app
