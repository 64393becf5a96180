// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/node/node_reports.hpp"

#include <array>
#include <cstdio>
#include <string_view>
#include <utility>

#include "palpate/io/bag/messages.hpp"

namespace palpate {
namespace {

using ros::DiagnosticStatus;
using ros::Marker;

constexpr double hip_radius = 3e-3;         // [m]
constexpr double line_width = 1e-3;         // [m]
constexpr double metres_per_newton = 0.05;  // of the force's arrow
constexpr double normal_length = 0.03;      // [m]
constexpr std::uint32_t lifetime = 1;       // [s] after which they go if the node has gone
constexpr double least_share = 0.9;         // [-] of the loop's rate: less is worth a warning

constexpr std::array<float, 4> proxy_colour{0.20F, 0.60F, 1.00F, 0.70F};
constexpr std::array<float, 4> touching_colour{0.20F, 0.80F, 0.30F, 0.80F};
constexpr std::array<float, 4> hip_colour{1.00F, 0.60F, 0.10F, 0.90F};
constexpr std::array<float, 4> force_colour{0.90F, 0.20F, 0.20F, 1.00F};
constexpr std::array<float, 4> normal_colour{0.60F, 0.60F, 0.60F, 1.00F};

Marker marker(const ros::Header& header, const std::string& name, Marker::Kind kind,
              const std::array<float, 4>& colour) {
  Marker made;
  made.header = header;
  made.ns = name;
  made.kind = kind;
  made.colour = colour;
  made.lifetime = {lifetime, 0};
  return made;
}

Marker ball(const ros::Header& header, const std::string& name, const Vec3& place, double radius,
            const std::array<float, 4>& colour) {
  Marker made = marker(header, name, Marker::sphere, colour);
  made.position = components(place);
  made.scale = {2.0 * radius, 2.0 * radius, 2.0 * radius};
  return made;
}

// None where there is nothing to point at: what was drawn before goes.
Marker arrow(const ros::Header& header, const std::string& name, const Vec3& from, const Vec3& way,
             const std::array<float, 4>& colour) {
  Marker made = marker(header, name, Marker::arrow, colour);
  if (way.norm() < line_width) {
    made.action = Marker::remove;
    return made;
  }
  made.points = {components(from), components(from + way)};
  made.scale = {2.0 * line_width, 4.0 * line_width, 0.0};  // shaft, head
  return made;
}

std::string number(double value, const char* format = "%.4g") {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

template <class Names>
std::string names_of(std::uint32_t bits, const Names& names) {
  std::string text;
  std::size_t i = 0;
  for (const auto& name : names) {
    if ((bits >> i++ & 1U) != 0) text += (text.empty() ? "" : " ") + std::string(name);
  }
  return text;
}

std::string tick_flags(std::uint32_t bits) {
  std::vector<std::string_view> names;
  for (const TickFlagInfo& flag : tick_flag_table()) names.push_back(flag.name);
  return names_of(bits, names);
}

DiagnosticStatus status(const std::string& name, std::uint8_t level, std::string message) {
  DiagnosticStatus made;
  made.level = level;
  made.name = "palpate: " + name;
  made.message = std::move(message);
  return made;
}

DiagnosticStatus loop_status(const SessionReport& report) {
  const SessionState& state = report.state;
  DiagnosticStatus made = status("servo loop", DiagnosticStatus::ok, "runs");
  if (report.tick_rate == 0.0) {
    made.level = DiagnosticStatus::error;
    made.message = "there are no ticks";
  } else if (report.tick_rate < least_share * state.rate || report.late_ticks > 0) {
    made.level = DiagnosticStatus::warn;
    made.message = "ticks are late; see palpate doctor";
  }
  made.values = {{"rate [Hz]", number(report.tick_rate)},
                 {"rate asked for [Hz]", number(state.rate)},
                 {"late ticks", std::to_string(report.late_ticks)},
                 {"late ticks in all", std::to_string(state.hands[0].summary.late_ticks)},
                 {"method", state.settings.method}};
  return made;
}

DiagnosticStatus camera_status(const CameraStatus& camera, double now) {
  DiagnosticStatus made = status("camera " + camera.uri, DiagnosticStatus::ok, camera.text);
  if (camera.state == CameraState::frozen || camera.state == CameraState::searching)
    made.level = DiagnosticStatus::error;
  else if (camera.state != CameraState::live || !camera.doubt.empty())
    made.level = DiagnosticStatus::warn;
  made.hardware_id = camera.uri;
  made.values = {{"rate [Hz]", number(camera.rate)},
                 {"frames", std::to_string(camera.frames)},
                 {"frames dropped", std::to_string(camera.dropped)},
                 {"latency [s]", number(camera.latency)}};
  if (camera.last_frame)
    made.values.push_back({"age of the newest frame [s]", number(now - *camera.last_frame)});
  if (!camera.trouble.empty()) made.values.push_back({"trouble", camera.trouble});
  if (!camera.doubt.empty()) made.values.push_back({"doubt", camera.doubt});
  return made;
}

// What is said of a hand's contact.
struct Contact {
  std::string name;  // of the hand, with a blank behind it; empty: the first one
  const TickReport& ticks;
  std::uint32_t latched_by;
  std::size_t pop_throughs;
};

DiagnosticStatus contact_status(const Contact& contact, bool held) {
  const ServoTick& newest = contact.ticks.newest;
  DiagnosticStatus made =
      status(contact.name + "contact", DiagnosticStatus::ok, to_string(newest.tick.state));
  if (held) made.message += "; the force is paused (~/release ends this)";
  if (contact.latched_by != 0) {
    made.level = DiagnosticStatus::error;
    made.message = "no force: latched by " + names_of(contact.latched_by, safety_flag_names()) +
                   " (~/reset_faults ends that)";
  }
  made.values = {{"force asked for [N]", number(newest.tick.force.norm())},
                 {"force sent [N]", number(newest.force.norm())},
                 {"gain", number(newest.gain)},
                 {"age of the frame [s]", number(newest.frame_age)},
                 {"flags", tick_flags(contact.ticks.flags)},
                 {"safety flags", names_of(contact.ticks.safety, safety_flag_names())},
                 {"pop-throughs suspected", std::to_string(contact.pop_throughs)}};
  return made;
}

// @param name     as Contact's
// @param trouble  of the device, in more words than its fault has; may be empty
DiagnosticStatus device_status(const std::string& name, const TickReport& ticks,
                               const std::string& trouble, const DeviceInfo& device) {
  const std::uint32_t hand = ticks.newest.hand;
  DiagnosticStatus made = status(name + "device " + device.uri, DiagnosticStatus::ok, "no hand");
  if ((hand & hand_present) != 0) made.message = "held";
  if ((hand & hand_clutched) != 0) made.message = "clutched";
  if ((hand & hand_fault) != 0) {
    made.level = DiagnosticStatus::error;
    made.message = trouble.empty() ? std::string(describe(fault_of(hand))) : trouble;
  }
  made.hardware_id = device.serial.empty() ? device.uri : device.serial;
  made.values = {{"kind", device.kind},
                 {"fault", std::string(to_string(fault_of(hand)))},
                 {"largest force [N]", number(device.limits.max_force)}};
  return made;
}

DiagnosticStatus recording_status(const RecordingState& recording) {
  DiagnosticStatus made = status("recording", DiagnosticStatus::ok, "off");
  if (recording.on)
    made.message = "on";
  else if (recording.closing)
    made.message = "being written";
  if (recording.failed) {
    made.level = DiagnosticStatus::warn;
    made.message = recording.message;
  }
  made.values = {{"folder", recording.folder}, {"last", recording.message}};
  return made;
}

}  // namespace

ros::MarkerArray markers_of(const ServoTick& record, double contact_radius,
                            const ros::Header& header) {
  const Tick& tick = record.tick;
  const bool touches = tick.state != ContactState::free_motion;
  Marker line = marker(header, "hip_to_proxy", Marker::line_strip, hip_colour);
  line.points = {components(tick.hip), components(tick.proxy)};
  line.scale = {line_width, 0.0, 0.0};
  return {
      {ball(header, "proxy", tick.proxy, contact_radius, touches ? touching_colour : proxy_colour),
       ball(header, "hip", tick.hip, hip_radius, hip_colour), std::move(line),
       arrow(header, "force", tick.proxy, metres_per_newton * record.force, force_colour),
       arrow(header, "normal", tick.proxy, normal_length * tick.normal, normal_colour)}};
}

ros::DiagnosticArray diagnostics_of(const SessionReport& report, const DeviceInfo& device,
                                    const ros::Header& header) {
  ros::DiagnosticArray array;
  array.header = header;
  array.status.push_back(loop_status(report));
  for (const CameraStatus& camera : report.state.cameras)
    array.status.push_back(camera_status(camera, report.now));
  const SessionState& state = report.state;
  array.status.push_back(contact_status(
      {"", report.ticks, state.hands[0].latched_by, state.hands[0].summary.pop_throughs},
      state.held));
  array.status.push_back(device_status("", report.ticks, state.hands[0].device.text, device));
  for (std::size_t i = 0; i < report.more_hands.size() && i + 1 < state.hands.size(); ++i) {
    const SessionHandState& hand = state.hands[i + 1];
    const auto& [ticks, info] = report.more_hands[i];
    const std::string name = hand.name + " ";
    array.status.push_back(
        contact_status({name, ticks, hand.latched_by, hand.summary.pop_throughs}, state.held));
    array.status.push_back(device_status(name, ticks, hand.device.text, info));
  }
  array.status.push_back(recording_status(report.state.recording));
  return array;
}

}  // namespace palpate
