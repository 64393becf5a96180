// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/options.hpp"
#include "palpate/kernel/core/method.hpp"
#include "palpate/net/viewer/session_host.hpp"
#include "palpate/servo/device.hpp"
#include "palpate/session/config.hpp"
#include "palpate/session/session.hpp"

namespace palpate::app {

/// What a verb has beside its session. Each may be empty.
struct Beside {
  std::function<void(SessionOptions&)> prepare;  ///< before the session is made
  /// When it has been made; what is returned lives until the force is off.
  std::function<std::shared_ptr<void>(Session&)> attach;
  std::function<std::optional<RobotPicture>()> robot;  ///< what its pages draw; one thread
};

struct RunOptions {
  /// Adds the options of the session and of how it runs.
  /// @param headless_help  the help of --headless; null: there is no such option
  void add_to(CLI::App& command, const char* headless_help);

  SessionArguments session;
  std::optional<double> duration;
  bool headless = false;
  /// Headless: at the pace of time, also where nothing but simulations and recordings takes part.
  bool in_real_time = false;
  bool json = false;
  bool print_config = false;
  Beside beside = {};
  std::string whose_page =
      {};  ///< a word before the page's address, which is all that is said of it
  std::uint16_t usual_port = 8642;  ///< of the page, where none is asked for and it is free
};

constexpr double headless_duration = 10.0;  ///< [s]

/// All that a session can run: `ideal`, the lab's ruler, needs the truth.
MethodRegistry session_methods();

/// Prints the session as a TOML file where --print-config asks for it. @return does it?
bool prints_config(const RunOptions& options, const SessionConfig& config);

/// A device whose motors would keep their force if this process died, in a process of its own; null
/// for any other. Only while this process has one thread.
std::unique_ptr<Device> guarded_device(const std::string& uri);

/// That of each hand; null, too, where the user wants none (--without-watchdog).
using GuardedDevices = std::vector<std::unique_ptr<Device>>;
GuardedDevices guarded_devices(const SessionConfig& config);

/// What the signals that end the program have to do with its session.
struct Running {
  std::atomic<Session*> session{nullptr};
  std::atomic<bool> ended{false};

  void end() {
    ended = true;
    if (Session* now = session) now->request_stop();
  }
};

/// A session as the verbs want it: opens it, and says what there is to say of its method and of its
/// devices with motors. Unless a signal has come meanwhile, the verb's `beside` is attached.
struct OpenedSession {
  /// @param is_first  of this program; of others nothing is said of the method
  /// @throws Error for a duration out of range, or as Session
  OpenedSession(const RunOptions& options, const SessionConfig& config, GuardedDevices guarded,
                Running& running,
                std::function<void(std::size_t, const FedFrame&)> on_frame = nullptr,
                bool is_first = true);

  struct Announced {
    Running& running;
    ~Announced() { running.session = nullptr; }
  };
  Session session;
  Announced announced;
  std::shared_ptr<void> beside;
};

/// A session with its page, or without one; prints what there is to say.
/// @return the program's exit code
int run_session(const RunOptions& options, const SessionConfig& config);

/// Prints how the recording ended and the summary. @return the program's exit code
/// @param ended  why an observer's recording was ended by its limits; empty if it was not
int finish(Session& session, bool json, const std::string& ended = {});

}  // namespace palpate::app
