// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <png.h>
#include <sqlite3.h>
#include <unistd.h>

#include "app/machine.hpp"
#include "app/running_session.hpp"
#include "app/signals.hpp"
#include "app/summary_text.hpp"
#include "app/verbs.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/io/devices/device_probe.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/sensor.hpp"
#include "palpate/kernel/core/vectorise.hpp"
#include "palpate/net/viewer/server.hpp"
#include "palpate/servo/periodic_thread.hpp"
#include "palpate/servo/safety.hpp"
#include "palpate/servo/stiffness.hpp"
#include "palpate/session/session.hpp"

namespace palpate::app {
namespace {

using Json = nlohmann::ordered_json;

std::string word_of(const Json& value) { return value.get<std::string>(); }
double number_of(const Json& value) { return value.get<double>(); }

struct DoctorOptions {
  double seconds = 3.0;
  double rate = 1000.0;
  bool json = false;
  std::string device;             // to be measured instead of the computer
  bool agreed = false;            // the person beside the device has
  bool without_watchdog = false;  // an emergency stop is at hand
};

// Fit for haptics: what a hand does not feel. A wake-up half a tick late at 1 kHz is still in time.
constexpr double most_late = 0.5e-3;        // [s] 99.9 % of the wake-ups
constexpr double most_late_ticks = 1.0e-3;  // [-] share of ticks that are not done when due
// [s] After a single longer pause the safety chain takes the force off, and ramps it up again.
constexpr double longest_pause = SafetyParameters{}.stall_time;

bool is_fit(const Json& loop) {
  const double ticks = std::max(number_of(loop["ticks"]), 1.0);
  return loop["wake_up_p999_s"] <= most_late && loop["wake_up_max_s"] <= longest_pause &&
         number_of(loop["late_ticks"]) / ticks <= most_late_ticks;
}

// What may stand in the way of a loop that was late, each with its remedy.
// @param interrupts  on its core, during the measurement
void name_obstacles(const Machine& machine, const RealtimeReport& granted, double seconds,
                    const std::map<std::string, std::uint64_t>& interrupts,
                    std::vector<std::string>& advice) {
  constexpr double many_interrupts = 50.0;  // [1/s]
  for (const auto& [name, count] : interrupts) {
    if (static_cast<double>(count) < many_interrupts * seconds) continue;
    const std::string number = name.substr(0, name.find(':'));
    advice.push_back(
        fmt::format("core {}, which runs the servo loop, serves {:.0f} interrupts/s of '{}': stop "
                    "irqbalance and write another core to /proc/irq/{}/smp_affinity_list",
                    granted.core, static_cast<double>(count) / seconds, name, number));
  }
  if (!granted.awake && machine.deepest_sleep > most_late / 10.0)
    advice.push_back(
        fmt::format("cores sleep so deeply that they take {:.0f} us to wake: grant access to "
                    "/dev/cpu_dma_latency, or boot with processor.max_cstate=1",
                    1e6 * machine.deepest_sleep));
  if (machine.threads_share_cores)
    advice.emplace_back(
        "two hardware threads share each core (SMT), and the other one slows the servo loop down: "
        "echo off > /sys/devices/system/cpu/smt/control");
}

// Network devices and arms answer as fast as the card hands packets on.
void name_slow_cards(const Machine& machine, std::vector<std::string>& advice) {
  constexpr unsigned most_held_back = 50;  // [us]
  for (const NetworkCard& card : machine.network) {
    if (card.driver.rfind("r81", 0) == 0)
      advice.push_back(card.name + " is a Realtek network card (" + card.driver +
                       "), known for delays of some ms: use another card for a device or an arm "
                       "on the network");
    if (card.coalescing.value_or(0) > most_held_back)
      advice.push_back(
          fmt::format("{0} holds packets back for up to {1} us: for a device or an "
                      "arm on it, ethtool -C {0} rx-usecs 0",
                      card.name, *card.coalescing));
  }
}

// A loop that does nothing, whose late ticks are due to the machine; and after it a session: a
// simulated hand presses and strokes a simulated scene.
Json look_at_time(const DoctorOptions& options, const Machine& machine,
                  std::vector<std::string>& advice) {
  const auto half = std::chrono::duration<double>(0.5 * options.seconds);
  const std::uint64_t throttled_before = times_throttled();
  PeriodicThread thread(options.rate, RealtimeRequest{}, [](const Wake&) {});
  const RealtimeReport& granted = thread.realtime();
  auto interrupts = interrupts_on(granted.core);
  std::this_thread::sleep_for(half);
  thread.stop();
  for (auto& [name, count] : interrupts_on(granted.core))
    interrupts[name] = count - interrupts[name];

  SessionOptions wanted;
  wanted.cameras = {{.uri = "synthetic:desk"}};
  wanted.hands[0].device = "script:";
  wanted.rate = options.rate;
  wanted.stroke_time = 0.5 * options.seconds;
  Session session(std::move(wanted));
  session.run(half.count());

  Json loop = json_of(thread.timing());
  Json felt = json_of(*session.timing());
  const bool fit = is_fit(loop) && is_fit(felt);
  if (!fit) {
    advice.push_back(fmt::format(
        "servo ticks are late ({} of {} in an empty loop, {} of {} in a session, the latest by "
        "{:.1f} ms; {:.0f} ms take the force off): close other "
        "programs, grant the real-time permissions listed here, or install a PREEMPT_RT kernel",
        loop["late_ticks"].get<int>(), loop["ticks"].get<int>(), felt["late_ticks"].get<int>(),
        felt["ticks"].get<int>(),
        1e3 * std::max(number_of(loop["wake_up_max_s"]), number_of(felt["wake_up_max_s"])),
        1e3 * longest_pause));
    name_obstacles(machine, granted, half.count(), interrupts, advice);
  }
  if (const auto throttled = times_throttled(); throttled > throttled_before)
    advice.push_back(
        fmt::format("the processor was slowed down by its heat {} times meanwhile: "
                    "improve its cooling",
                    throttled - throttled_before));
  advice.insert(advice.begin(), granted.advice.begin(), granted.advice.end());
  const double delay = number_of(felt["wake_up_p999_s"]) + number_of(felt["compute_p999_s"]);
  Json report = {{"fit", fit},
                 {"rate_hz", options.rate},
                 {"delay_s", delay},
                 {"stiffness_per_damping_1_s", largest_stiffness(1.0, 1.0 / options.rate, delay)}};
  report.update(loop);
  report.update({{"session", std::move(felt)},
                 {"fifo_priority", granted.priority},
                 {"memory_locked", granted.locked},
                 {"core", granted.core},
                 {"kept_awake", granted.awake}});
  return report;
}

Json look_at_processor(const Machine& machine, std::vector<std::string>& advice) {
  for (const std::string& governor : machine.governors) {
    if (governor == "performance") continue;
    advice.push_back("the CPU frequency governor is '" + governor +
                     "': set it to 'performance' with cpupower frequency-set -g performance");
  }
  if (std::thread::hardware_concurrency() < 2)
    advice.emplace_back("there is only one core: cameras and page will delay the servo loop");
  if (machine.is_virtual)
    advice.emplace_back(
        "this is a virtual machine; its host can delay any servo tick: use a physical computer "
        "when a person holds the device");
  name_slow_cards(machine, advice);
  Json network = Json::array();
  for (const NetworkCard& card : machine.network)
    network.push_back(card.name + " (" + card.driver + ")");
  return {{"processor", machine.processor},
          {"cores", std::thread::hardware_concurrency()},
          {"vector_set", vector_set_in_use()},
          {"governors", machine.governors},
          {"isolated_cores", machine.isolated_cores},
          {"deepest_sleep_s", machine.deepest_sleep},
          {"threads_share_cores", machine.threads_share_cores},
          {"network", network},
          {"virtual", machine.is_virtual},
          {"kernel", machine.kernel},
          {"preemption", machine.preemption},
          {"share_for_realtime_threads", machine.fifo_share}};
}

// What the system shows, and whose driver it is.
Json look_at_devices(const Machine& machine, const Registry<Driver>& drivers,
                     std::vector<std::string>& advice) {
  Json found = Json::array();
  for (const FoundDevice& device : machine.devices) {
    const auto driver =
        std::find_if(drivers.entries().begin(), drivers.entries().end(),
                     [&](const Driver& one) { return is_usb_of(device.usb, one.usb); });
    const bool known = driver != drivers.entries().end();
    found.push_back({{"where", device.where},
                     {"name", device.name},
                     {"kind", device.kind},
                     {"driver", known ? driver->name + ":" : ""}});
    if (!known)
      advice.push_back(
          device.name + ": this version has no driver for it" +
          (device.kind == "camera"
               ? "; record its depth in a ROS 2 bag and open it with --camera recording:BAG"
               : ""));
  }
  return found;
}

// Empty where nobody says.
std::string sensor_text(SensorKind sensor) {
  if (sensor == SensorKind::unknown) return {};
  return fmt::format("{} (assumed noise: {})", name_of(sensor), noise_text(sensor));
}

// What each driver finds: library or service, and what is plugged in.
Json look_at_drivers(const Machine& machine, const Registry<Driver>& drivers,
                     std::vector<std::string>& advice) {
  Json found = Json::array();
  for (const Driver& driver : drivers.entries()) {
    const DriverReport report = driver.look();
    Json plugged_in = Json::array();
    for (const PluggedIn& one : report.found) {
      plugged_in.push_back({{"uri", one.uri},
                            {"name", one.name},
                            {"serial", one.serial},
                            {"firmware", one.firmware},
                            {"rate_hz", one.rate ? Json(*one.rate) : Json()},
                            {"noise", sensor_text(one.sensor)},
                            {"note", one.note}});
      if (!one.note.empty()) advice.push_back(one.uri + ": " + one.note);
    }
    found.push_back({{"name", driver.name + ":"},
                     {"kind", driver.open_camera ? "camera" : "haptic device"},
                     {"summary", driver.summary},
                     {"tried", driver.tried},
                     {"library", report.library},
                     {"version", report.version},
                     {"problem", report.problem},
                     {"found", plugged_in}});
    const bool is_here =
        std::any_of(machine.devices.begin(), machine.devices.end(),
                    [&](const FoundDevice& device) { return is_usb_of(device.usb, driver.usb); });
    if (is_here && !report.problem.empty()) advice.push_back(report.problem);
  }
  return found;
}

Json versions() {
  const bool has_page = page_files().size() > 1;
  return {{"palpate", PALPATE_VERSION},
          {"page", has_page ? "built in" : "not built in"},
          {"compiler", __VERSION__},
          {"eigen",
           fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
          {"libpng", png_get_libpng_ver(nullptr)},
          {"sqlite", sqlite3_libversion()},
          {"fmt", fmt::format("{}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100,
                              FMT_VERSION % 100)},
          {"nlohmann_json", fmt::format("{}.{}.{}", NLOHMANN_JSON_VERSION_MAJOR,
                                        NLOHMANN_JSON_VERSION_MINOR, NLOHMANN_JSON_VERSION_PATCH)},
          {"cli11", CLI11_VERSION}};
}

std::string listed(const Json& object) {
  std::string text;
  for (const auto& [key, value] : object.items()) {
    const bool is_text = value.is_string();
    if (is_text && word_of(value).empty()) continue;
    if (value.is_array() && value.empty()) continue;
    text += fmt::format("  {}: {}\n", key, is_text ? word_of(value) : value.dump());
  }
  return text;
}

std::string drivers_text(const Json& drivers) {
  if (drivers.empty()) return {};
  std::string text = "\nDrivers\n";
  for (const Json& driver : drivers) {
    const auto word = [&](const char* key) { return word_of(driver[key]); };
    text += fmt::format("  {} {}; tested with {}\n", word("name"), word("summary"), word("tried"));
    if (!word("library").empty())
      text += fmt::format("    found {}{}\n", word("library"),
                          word("version").empty() ? "" : ", version " + word("version"));
    if (!word("problem").empty()) text += fmt::format("    {}\n", word("problem"));
    for (const Json& one : driver["found"]) {
      text += fmt::format("    {}: {}", word_of(one["uri"]), word_of(one["name"]));
      for (const char* key : {"serial", "firmware"}) {
        const auto value = word_of(one[key]);
        if (!value.empty()) text += fmt::format(", {} {}", key, value);
      }
      if (one["rate_hz"].is_number()) text += fmt::format(", {:.0f} Hz", number_of(one["rate_hz"]));
      if (const auto noise = word_of(one["noise"]); !noise.empty()) text += ", " + noise;
      text += "\n";
    }
  }
  return text;
}

std::string loop_text(const char* name, const Json& loop) {
  std::string text = fmt::format("{}, {} ticks\n", name, loop["ticks"].get<std::uint64_t>());
  for (const auto& [what, key] :
       {std::pair{"wake-up latency", "wake_up"}, {"compute", "compute"}}) {
    const auto microseconds = [&, name = std::string(key)](const char* share) {
      return 1e6 * number_of(loop[name + share]);
    };
    text +=
        fmt::format("  {}: {:.0f} us median, {:.0f} at 99 %, {:.0f} at 99.9 %, {:.0f} maximum\n",
                    what, microseconds("_p50_s"), microseconds("_p99_s"), microseconds("_p999_s"),
                    microseconds("_max_s"));
  }
  const auto number = [&](const char* key) { return loop[key].get<std::int64_t>(); };
  const auto late = number("late_ticks");
  const auto computed = number("late_by_compute");
  const auto interrupted = number("late_by_interruption");
  return text + fmt::format(
                    "  missed deadlines: {} ({} woken late, {} interrupted, {} by the tick's own "
                    "work)\n",
                    late, late - computed - interrupted, interrupted, computed);
}

std::string doctor_text(const Json& report) {
  const Json& time = report["realtime"];
  std::string text = fmt::format(
      "{} for haptics at {} Hz: with its delay of {:.2f} ms a device may have walls of up to "
      "{:.0f} N/m for each N s/m of its damping\n\n{}{}  real-time scheduling: {}; memory: {}; "
      "core: {}; "
      "cores: {}\n",
      report["fit"].get<bool>() ? "Fit" : "Not fit", number_of(time["rate_hz"]),
      1e3 * number_of(time["delay_s"]), number_of(time["stiffness_per_damping_1_s"]),
      loop_text("Empty servo loop", time), loop_text("Session", time["session"]),
      time["fifo_priority"] == 0 ? "refused"
                                 : "priority " + std::to_string(time["fifo_priority"].get<int>()),
      time["memory_locked"].get<bool>() ? "locked" : "not locked",
      time["core"] == -1 ? "not pinned" : std::to_string(time["core"].get<int>()),
      time["kept_awake"].get<bool>() ? "kept awake" : "may sleep");
  text += "\nMachine\n" + listed(report["machine"]) + "\nCameras and haptic devices\n";
  for (const Json& device : report["devices"])
    text += fmt::format(
        "  {}: {} ({}), {}\n", word_of(device["where"]), word_of(device["name"]),
        word_of(device["kind"]),
        word_of(device["driver"]).empty() ? "no driver" : "driver " + word_of(device["driver"]));
  if (report["devices"].empty()) text += "  none found\n";
  text += drivers_text(report["drivers"]);
  text += "\nVersions\n" + listed(report["versions"]);
  if (!report["advice"].empty()) text += "\nRecommended actions\n";
  for (const Json& line : report["advice"]) text += fmt::format("  - {}\n", word_of(line));
  return text;
}

void print(const Json& report, bool as_json, std::string (*in_words)(const Json&)) {
  const std::string text = as_json
                               ? report.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"
                               : in_words(report);
  std::fputs(text.c_str(), stdout);
}

constexpr double gravity = 9.80665;  // [m/s^2]

void ask_for_consent(const DoctorOptions& wanted, const ProbeOptions& options) {
  if (wanted.agreed) return;
  if (isatty(STDIN_FILENO) != 1)
    throw Error("doctor --device " + wanted.device,
                "the measurement moves the device and was not confirmed",
                "clear the space around the handle, stay next to the device, and add --yes");
  fmt::print(
      stderr,
      "palpate: {} will move its handle by itself, back and forth along each axis, for up to a "
      "minute,\n  with at most {} N and {:.0f} mm. Put the handle in the centre of its "
      "workspace,\n  free to move, hands off, the emergency stop within reach. Type yes to begin: ",
      wanted.device, options.force, 1e3 * options.travel);
  std::string answer;
  std::getline(std::cin, answer);
  if (answer != "yes")
    throw Error("doctor --device " + wanted.device, "the measurement was not confirmed",
                "type yes, or add --yes");
}

// A device with motors must let go by itself when this process is killed.
std::unique_ptr<Device> open_watched(const DoctorOptions& wanted) {
  std::unique_ptr<Device> device;
  if (!wanted.without_watchdog) device = guarded_device(wanted.device);
  if (!device) device = open_device(wanted.device, HipPath({{0.0, Vec3::Zero()}}), all_devices());
  const DeviceInfo& info = device->info();
  constexpr double longest_watchdog = 0.5;  // [s] as a session's
  const bool watched = info.watchdog && *info.watchdog <= longest_watchdog;
  if (info.limits.motors && !info.simulated && !watched && !wanted.without_watchdog)
    throw Error(wanted.device,
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
                 {"stalls", found.stalls},
                 {"longest_stall_s", found.longest_stall},
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
    return fmt::format("{:.{}f} ± {:.{}f}", scale * number_of(figure["value"]), decimals,
                       scale * number_of(figure["error"]), decimals);
  };
  std::string text = fmt::format("{}: {}\n\n", word_of(report["device"]), word_of(report["kind"]));
  for (const Json& axis : report["axes"])
    text += fmt::format(
        "  {} axis: {} g, damping {} N s/m, friction {} N, load {} N ({} strokes)\n",
        word_of(axis["axis"]), with_error(axis["mass_kg"], 1e3, 1),
        with_error(axis["damping_ns_m"], 1.0, 2), with_error(axis["friction_n"], 1.0, 3),
        with_error(axis["load_n"], 1.0, 3), axis["swings"].get<int>());
  if (!report["delay_s"].is_null())
    text += fmt::format("  actuation delay: {} ms\n", with_error(report["delay_s"], 1e3, 2));
  const auto line = [&](const char* key, const char* what, double scale, const char* unit) {
    if (!report[key].is_null())
      text += fmt::format("  {}: {:.4g} {}\n", what, scale * number_of(report[key]), unit);
  };
  line("resolution_m", "position resolution", 1e3, "mm");
  line("noise_m", "position noise at rest, rms", 1e3, "mm");
  line("tick_rate_hz", "ticks", 1.0, "a second");
  line("update_rate_hz", "position updates", 1.0, "a second");
  line("largest_force_n", "largest test force", 1.0, "N");
  line("farthest_m", "largest displacement of the handle", 1e3, "mm");
  if (report["stalls"] != 0) line("longest_stall_s", "longest stall of this computer", 1e3, "ms");
  text += "\n";
  if (const Json& proposal = report["proposal"]; !proposal.is_null()) {
    text += fmt::format(
        "Proposed: --rate {:.0f} --set stiffness={:.0f} --set damping={:g}\n  ({:.0f} N/m without "
        "damping; with these values a released handle is stable)\n",
        number_of(proposal["rate_hz"]), std::floor(number_of(proposal["stiffness_n_m"])),
        number_of(proposal["damping_ns_m"]),
        std::floor(number_of(proposal["undamped_stiffness_n_m"])));
    if (proposal.contains("handle_weight_kg"))
      text += fmt::format(
          "  uncompensated handle mass: {:.0f} g; direction of gravity in the device frame: "
          "({:.2f}, {:.2f}, {:.2f})\n",
          1e3 * number_of(proposal["handle_weight_kg"]), number_of(proposal["down"][0]),
          number_of(proposal["down"][1]), number_of(proposal["down"][2]));
  } else {
    text += "No proposal: the values are too uncertain\n";
  }
  text += report["sure"].get<bool>() ? "The values are consistent\n" : "";
  for (const Json& doubt : report["doubts"]) text += fmt::format("  - {}\n", word_of(doubt));
  return text;
}

// Measures a device by its own motors, with consent, and prints what it found.
int check_device(const DoctorOptions& wanted) {
  ProbeOptions options;
  const std::unique_ptr<Device> device = open_watched(wanted);
  const DeviceInfo& info = device->info();
  if (!info.limits.motors)
    throw Error("doctor --device " + wanted.device, "it has no motors",
                "give a haptic device, or a simulated one: hand:?device=touch&grip=none");
  if (!info.simulated) ask_for_consent(wanted, options);
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
  print(report, wanted.json, report_text);
  return found.ended.empty() ? 0 : 1;
}

int run(const DoctorOptions& options) {
  if (!options.device.empty()) return check_device(options);
  if (options.agreed || options.without_watchdog)
    throw Error("doctor", "--yes and --without-watchdog are for a device",
                "add --device URI, or remove these options");
  if (!(options.seconds >= 0.1 && options.seconds <= 3600.0))
    throw Error("--seconds", fmt::format("{} s is too short or too long", options.seconds),
                "give 0.1 to 3600");
  if (!(options.rate >= 100.0 && options.rate <= 10'000.0))
    throw Error("--rate", fmt::format("{} Hz is not a servo rate", options.rate),
                "give 100 to 10000");
  if (isatty(STDERR_FILENO) == 1)
    fmt::print(stderr, "palpate: measuring for {} s\n", options.seconds);
  const Machine machine = look_at_machine();
  const Registry<Driver> drivers = standard_drivers();
  std::vector<std::string> advice;
  Json report;
  report["realtime"] = look_at_time(options, machine, advice);
  report["fit"] = report["realtime"]["fit"];
  report["machine"] = look_at_processor(machine, advice);
  report["devices"] = look_at_devices(machine, drivers, advice);
  report["drivers"] = look_at_drivers(machine, drivers, advice);
  report["versions"] = versions();
  report["advice"] = advice;
  print(report, options.json, doctor_text);
  return 0;
}

}  // namespace

Verb add_doctor(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "doctor",
      "check this computer for haptics, list connected cameras and devices, and recommend actions");
  const auto options = std::make_shared<DoctorOptions>();
  command->add_option(
      "--seconds", options->seconds,
      "duration of the measurement [s] (3): half of it an empty loop, half a session");
  command->add_option("--rate", options->rate, "ticks per second (1000)");
  command->add_flag("--json", options->json, "print a JSON object");
  command->add_option("--device", options->device,
                      "measure this haptic device instead, by moving its handle with less than 0.5 "
                      "N: mass, damping, friction, delay, and the largest stable stiffness");
  command->add_flag("--yes", options->agreed,
                    "confirm the measurement: the handle is free to move and nobody holds it");
  command->add_flag("--without-watchdog", options->without_watchdog,
                    "measure a device without a watchdog. Danger: if this program is killed, the "
                    "last force stays on; keep an emergency stop within reach");
  return {command, [options] { return run(*options); }};
}

}  // namespace palpate::app
