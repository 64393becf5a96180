// SPDX-License-Identifier: Apache-2.0
#include "app/running_session.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include <fmt/format.h>

#include "app/program.hpp"
#include "app/summary_text.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/io/devices/device_guard.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/servo/stiffness.hpp"

namespace palpate::app {
namespace {

// Can it run faster than time? Only where nothing but simulations and recordings takes part.
bool can_run_freely(const SessionConfig& config) {
  const Registry<Driver> drivers = standard_drivers();
  for (const CameraSpec& camera : config.cameras) {
    if (drivers.try_find(Uri(camera.uri).scheme()) != nullptr) return false;
    if (open_source(camera.uri)->info().live) return false;
  }
  const auto is_simulated = [](const std::string& device) {
    const std::string scheme = Uri(device).scheme();
    return scheme == "hand" || scheme == "script";
  };
  return std::all_of(config.hands.begin(), config.hands.end(), [&](const HandSpec& hand) {
    return hand.device.empty() || is_simulated(hand.device);
  });
}

// @param hand  its name; empty: it is the only one
void introduce_device(const DeviceInfo& device, const std::string& hand,
                      const ServoSettings& settings, double rate) {
  std::string text = hand.empty() ? "" : hand + ": ";
  text += fmt::format("{}: {}", device.uri, device.kind);
  if (!device.serial.empty()) text += ", serial number " + device.serial;
  text += fmt::format("; at most {:.2g} N, {:.2g} N continuously", device.limits.max_force,
                      device.limits.continuous_force);
  if (device.limits.max_stiffness)
    text += fmt::format(", walls up to {:.0f} N/m", *device.limits.max_stiffness);
  if (device.reach) {
    const Vec3 size = 1e3 * (device.reach->highest - device.reach->lowest);
    text += fmt::format(", {:.0f} x {:.0f} x {:.0f} mm", size.x(), size.y(), size.z());
  }
  if (device.watchdog) text += fmt::format(", watchdog {:.0f} ms", 1e3 * *device.watchdog);
  const Registry<Driver> drivers = standard_drivers();
  if (const Driver* driver = drivers.try_find(Uri(device.uri).scheme()))
    text += "; driver tested with " + driver->tried;
  fmt::print(stderr, "palpate: {}\n", text);
  for (const std::string& line : stiffness_warnings(device, settings.parameters.coupling.stiffness,
                                                    settings.placement.workspace_scale, rate))
    fmt::print(stderr, "palpate: {}: {}\n", device.uri, line);
}

// @throws Error for a duration out of range.
SessionOptions options_of(const RunOptions& options, const SessionConfig& config) {
  if (options.duration && !(*options.duration >= 0.1 && *options.duration <= 86400.0))
    throw Error("--duration", fmt::format("{} s is too short or too long", *options.duration),
                "give 0.1 to 86400 s");
  validate(config);
  SessionOptions session;
  static_cast<SessionSpec&>(session) = static_cast<const SessionSpec&>(config);
  session.methods = session_methods();
  std::string& device = session.hands.front().device;
  if (device.empty()) device = options.headless ? "hand:" : "mouse:";
  session.version = PALPATE_VERSION;
  if (options.headless) {
    if (!options.in_real_time && can_run_freely(config)) session.pace = Pace::free_running;
    session.stroke_time = std::max(options.duration.value_or(headless_duration), 2.0);
  }
  return session;
}

// About a method whose ticks are not bounded.
void warn_of_late_ticks(const Session& session) {
  const std::string name = session.settings().method;
  if (!session_methods().find(name).bounded)
    fmt::print(stderr, "palpate: {} is a method of the lab: its ticks can be late\n", name);
}

// What devices with motors are good for, and what speaks against the settings on them.
void introduce(const Session& session, const SessionConfig& config) {
  for (std::size_t hand = 0; hand < session.hands(); ++hand) {
    const DeviceInfo& device = session.device(hand).info();
    if (!device.limits.motors || device.simulated) continue;
    introduce_device(device, session.hand_name(hand), session.settings(), config.rate);
  }
}

}  // namespace

MethodRegistry session_methods() {
  const MethodRegistry all = program_methods();
  MethodRegistry methods("method", "", {});
  for (const MethodInfo& method : all.entries()) {
    if (method.name != "ideal") methods.add(method);
  }
  return methods;
}

void RunOptions::add_to(CLI::App& command, const char* headless_help) {
  session.add_to(command);
  const std::string end = headless_help == nullptr ? "" : "; headless 10";
  command.add_option("--duration", duration, "seconds of the session (until Ctrl-C" + end + ")");
  if (headless_help != nullptr) command.add_flag("--headless", headless, headless_help);
  command.add_flag("--json", json, "print the summary as a JSON object");
  command.add_flag("--print-config", print_config,
                   "print the session of these options as a TOML file, and exit");
}

bool prints_config(const RunOptions& options, const SessionConfig& config) {
  if (options.print_config) std::fputs(to_toml(config).c_str(), stdout);
  return options.print_config;
}

GuardedDevices guarded_devices(const SessionConfig& config) {
  GuardedDevices devices;
  for (const HandSpec& hand : config.hands)
    devices.push_back(config.without_watchdog ? nullptr : guarded_device(hand.device));
  return devices;
}

std::unique_ptr<Device> guarded_device(const std::string& uri) {
  if (uri.empty()) return nullptr;
  const Registry<Driver> drivers = standard_drivers();
  const Driver* driver = drivers.try_find(Uri(uri).scheme());
  if (driver == nullptr || !driver->needs_guard) return nullptr;
  return open_guarded([&] { return driver->open_device(Uri(uri)); });
}

OpenedSession::OpenedSession(const RunOptions& options, const SessionConfig& config,
                             GuardedDevices guarded, Running& running,
                             std::function<void(std::size_t, const FedFrame&)> on_frame,
                             bool is_first)
    : session([&] {
        SessionOptions wanted = options_of(options, config);
        wanted.open_devices = std::move(guarded);
        wanted.on_frame = std::move(on_frame);
        if (options.beside.prepare) options.beside.prepare(wanted);
        return wanted;
      }()),
      announced{running} {
  if (is_first) warn_of_late_ticks(session);
  running.session = &session;
  introduce(session, config);
  if (!running.ended && options.beside.attach) beside = options.beside.attach(session);
}

int finish(Session& session, bool json, const std::string& ended) {
  const SessionState state = session.state();
  std::string recording = state.recording.message;
  if (!ended.empty()) recording += (recording.empty() ? "" : "; ") + ended;
  if (!recording.empty()) fmt::print(stderr, "palpate: {}\n", recording);
  if (const std::string& folder = state.recording.folder;
      !folder.empty() && !state.recording.failed)
    fmt::print(stderr,
               "palpate: check its forces: palpate replay {0}; touch it: palpate run --camera "
               "recording:{0}\n",
               folder);
  const std::string text = json ? json_of(state.hands, recording, state.cameras, session.timing(),
                                          &session.statistics().hand_over)
                                : text_of(state.hands, state.cameras);
  std::fputs(text.c_str(), stdout);
  return state.recording.failed ? 1 : 0;
}

}  // namespace palpate::app
