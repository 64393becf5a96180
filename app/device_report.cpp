// SPDX-License-Identifier: Apache-2.0
#include "app/device_report.hpp"

#include <atomic>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "app/signals.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/io/devices/device_guard.hpp"
#include "palpate/io/devices/device_probe.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::app {
namespace {

using Json = nlohmann::ordered_json;

constexpr double gravity = 9.80665;  // [m/s^2]

void ask_for_consent(const DeviceCheck& check, const ProbeOptions& options) {
  if (check.agreed) return;
  if (isatty(STDIN_FILENO) != 1)
    throw Error("doctor --device " + check.uri,
                "the measurement moves the device and was not confirmed",
                "clear the space around the handle, stay next to the device, and add --yes");
  fmt::print(
      stderr,
      "palpate: {} will move its handle by itself, back and forth along each axis, for up to a "
      "minute,\n  with at most {} N and {:.0f} mm. Put the handle in the centre of its "
      "workspace,\n  free to move, hands off, the emergency stop within reach. Type yes to begin: ",
      check.uri, options.force, 1e3 * options.travel);
  std::string answer;
  std::getline(std::cin, answer);
  if (answer != "yes")
    throw Error("doctor --device " + check.uri, "the measurement was not confirmed",
                "type yes, or add --yes");
}

// A device with motors must let go by itself when this process is killed.
std::unique_ptr<Device> open_watched(const DeviceCheck& check) {
  const Registry<Driver> drivers = standard_drivers();
  const Uri uri(check.uri);
  const Driver* driver = drivers.try_find(uri.scheme());
  std::unique_ptr<Device> device;
  if (driver != nullptr && driver->needs_guard && !check.without_watchdog)
    device = open_guarded([&] { return driver->open_device(uri); });
  else
    device = open_device(check.uri, HipPath({{0.0, Vec3::Zero()}}), all_devices(drivers));
  const DeviceInfo& info = device->info();
  constexpr double longest_watchdog = 0.5;  // [s] as a session's
  const bool watched = info.watchdog && *info.watchdog <= longest_watchdog;
  if (info.limits.motors && !info.simulated && !watched && !check.without_watchdog)
    throw Error(check.uri,
                "it has no watchdog that switches the force off when this process is killed",
                "keep an emergency stop within reach and add --without-watchdog");
  return device;
}

Json measured_json(const Measured& figure) {
  return {{"value", figure.value}, {"error", figure.error}};
}

Json report_json(const DeviceInfo& info, const DeviceMeasurement& found,
                 const std::optional<DeviceProposal>& proposal) {
  const auto number = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json();
  };
  Json axes = Json::array();
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& fit = found.fit.axes[i];
    if (!fit) continue;
    axes.push_back({{"axis", std::string(1, "xyz"[i])},
                    {"mass_kg", measured_json(fit->mass)},
                    {"damping_ns_m", measured_json(fit->damping)},
                    {"friction_n", measured_json(fit->friction)},
                    {"load_n", measured_json(fit->load)},
                    {"swings", fit->swings},
                    {"misfit", fit->misfit}});
  }
  Json report = {{"device", info.uri},
                 {"kind", info.kind},
                 {"sure", found.doubts.empty() && proposal.has_value()},
                 {"doubts", found.doubts},
                 {"axes", axes},
                 {"delay_s", found.fit.delay ? measured_json(*found.fit.delay) : Json()},
                 {"resolution_m", number(found.resolution)},
                 {"noise_m", number(found.noise)},
                 {"tick_rate_hz", found.tick_rate},
                 {"update_rate_hz", number(found.update_rate)},
                 {"largest_force_n", found.largest_force},
                 {"farthest_m", found.farthest},
                 {"proposal", nullptr}};
  if (proposal) {
    report["proposal"] = {{"rate_hz", proposal->rate},
                          {"stiffness_n_m", proposal->stiffness},
                          {"damping_ns_m", proposal->damping},
                          {"undamped_stiffness_n_m", proposal->undamped}};
    if (proposal->load) {
      const Vec3 down = proposal->load->normalized();
      report["proposal"]["handle_weight_kg"] = proposal->load->norm() / gravity;
      report["proposal"]["down"] = {down.x(), down.y(), down.z()};
    }
  }
  return report;
}

std::string report_text(const Json& report) {
  const auto with_error = [](const Json& figure, double scale, int decimals) {
    return fmt::format("{:.{}f} ± {:.{}f}", scale * figure["value"].get<double>(), decimals,
                       scale * figure["error"].get<double>(), decimals);
  };
  std::string text = fmt::format("{}: {}\n\n", report["device"].get<std::string>(),
                                 report["kind"].get<std::string>());
  for (const Json& axis : report["axes"])
    text += fmt::format(
        "  {} axis: {} g, damping {} N s/m, friction {} N, load {} N ({} strokes)\n",
        axis["axis"].get<std::string>(), with_error(axis["mass_kg"], 1e3, 1),
        with_error(axis["damping_ns_m"], 1.0, 2), with_error(axis["friction_n"], 1.0, 3),
        with_error(axis["load_n"], 1.0, 3), axis["swings"].get<int>());
  if (!report["delay_s"].is_null())
    text += fmt::format("  actuation delay: {} ms\n", with_error(report["delay_s"], 1e3, 2));
  const auto line = [&](const char* key, const char* what, double scale, const char* unit) {
    if (!report[key].is_null())
      text += fmt::format("  {}: {:.4g} {}\n", what, scale * report[key].get<double>(), unit);
  };
  line("resolution_m", "position resolution", 1e3, "mm");
  line("noise_m", "position noise at rest, rms", 1e3, "mm");
  line("tick_rate_hz", "ticks", 1.0, "a second");
  line("update_rate_hz", "position updates", 1.0, "a second");
  line("largest_force_n", "largest test force", 1.0, "N");
  line("farthest_m", "largest displacement of the handle", 1e3, "mm");
  text += "\n";
  if (const Json& proposal = report["proposal"]; !proposal.is_null()) {
    text += fmt::format(
        "Proposed: --rate {:.0f} --set stiffness={:.0f} --set damping={:g}\n  ({:.0f} N/m without "
        "damping; with these values a released handle is stable)\n",
        proposal["rate_hz"].get<double>(), std::floor(proposal["stiffness_n_m"].get<double>()),
        proposal["damping_ns_m"].get<double>(),
        std::floor(proposal["undamped_stiffness_n_m"].get<double>()));
    if (proposal.contains("handle_weight_kg"))
      text += fmt::format(
          "  uncompensated handle mass: {:.0f} g; direction of gravity in the device frame: "
          "({:.2f}, {:.2f}, {:.2f})\n",
          1e3 * proposal["handle_weight_kg"].get<double>(), proposal["down"][0].get<double>(),
          proposal["down"][1].get<double>(), proposal["down"][2].get<double>());
  } else {
    text += "No proposal: the values are too uncertain\n";
  }
  text += report["sure"].get<bool>() ? "The values are consistent\n" : "";
  for (const Json& doubt : report["doubts"])
    text += fmt::format("  - {}\n", doubt.get<std::string>());
  return text;
}

}  // namespace

int check_device(const DeviceCheck& check) {
  ProbeOptions options;
  const std::unique_ptr<Device> device = open_watched(check);
  const DeviceInfo& info = device->info();
  if (!info.limits.motors)
    throw Error("doctor --device " + check.uri, "it has no motors",
                "give a haptic device, or a simulated one: hand:?device=touch&grip=none");
  if (!info.simulated) ask_for_consent(check, options);
  std::atomic<bool> cancelled{false};
  options.cancelled = [&cancelled] { return cancelled.load(); };
  DeviceMeasurement found;
  {
    const EndingSignals signals([&cancelled] { cancelled = true; });
    if (!info.simulated && isatty(STDERR_FILENO) == 1)
      fmt::print(stderr, "palpate: measuring; Ctrl-C switches the force off\n");
    found = measure_device(*device, options);
  }
  const Json report = report_json(info, found, propose(info, found));
  const std::string text = check.json
                               ? report.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"
                               : report_text(report);
  std::fputs(text.c_str(), stdout);
  return found.ended.empty() ? 0 : 1;
}

}  // namespace palpate::app
