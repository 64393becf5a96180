// SPDX-License-Identifier: Apache-2.0
#pragma once

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

}  // namespace palpate::app
