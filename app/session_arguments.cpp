// SPDX-License-Identifier: Apache-2.0
#include "app/session_arguments.hpp"

#include <algorithm>
#include <filesystem>

#include "palpate/drivers/drivers.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"

namespace palpate::app {
namespace {

// The cameras named on the command line, with what the file says of those of the same URI.
std::vector<CameraSpec> chosen(const std::vector<std::string>& uris,
                               const std::vector<CameraSpec>& in_file) {
  std::vector<CameraSpec> cameras;
  for (const std::string& uri : uris) {
    const auto known = std::find_if(in_file.begin(), in_file.end(),
                                    [&](const CameraSpec& camera) { return camera.uri == uri; });
    cameras.push_back(known == in_file.end() ? CameraSpec{.uri = uri} : *known);
  }
  return cameras;
}

}  // namespace

void apply_placement(const std::optional<std::string>& pose, const std::optional<double>& scale,
                     const std::optional<int>& clutch_button, Placement& placement) {
  if (pose) {
    std::error_code unused;
    if (std::filesystem::is_regular_file(*pose, unused)) {
      placement.world_from_device =
          read_session_config(*pose).hands.front().placement.world_from_device;
    } else if (pose->find(',') == std::string::npos && pose->find(' ') == std::string::npos) {
      throw Error("--device-pose " + *pose, "there is no such file",
                  "give x,y,z,qx,qy,qz,qw or the TOML file that palpate calibrate wrote");
    } else {
      placement.world_from_device = parse_pose(*pose, "--device-pose");
    }
  }
  if (scale) placement.workspace_scale = *scale;
  if (clutch_button) placement.clutch_button = clutch_button;
  validate(placement);
}

void SessionArguments::add_to(CLI::App& command) {
  command
      .add_option("--camera", cameras_,
                  "source of the frames (synthetic:desk?noise=1mm); may be given several times; "
                  "?pose=x,y,z,qx,qy,qz,qw sets the camera pose")
      ->allow_extra_args(false);
  command.add_option("--material", material_,
                     "material of the surfaces: wood or another name of `palpate parameters` for "
                     "all of them, or a TOML file that assigns materials by colour or label");
  command.add_option("--fixtures", fixtures_,
                     "TOML file of virtual fixtures: forbidden regions, guides, viscous regions");
  command
      .add_option(
          "--device", devices_,
          "haptic device: mouse: on the page (the default), hand: a simulated user (the default "
          "with --headless), script:FILE.csv a path; given several times, one hand for each")
      ->allow_extra_args(false);
  command.add_option(
      "--device-pose", device_pose_,
      "pose of the device in the scene: x,y,z,qx,qy,qz,qw [m], or the TOML file that palpate "
      "calibrate wrote. With several hands, this option and --scale, --bubble, --handle-weight and "
      "--clutch-button are for the first; set those of the others in [[hand]] of --config");
  command.add_option("--scale", scale_, "motion scale: scene metres per device metre (1)");
  command.add_option(
      "--bubble", bubble_,
      "radius [m] around the centre of the device workspace outside which the HIP keeps moving in "
      "that direction (rate control), to reach points outside the workspace; 0: off (0)");
  command.add_option("--handle-weight", handle_weight_,
                     "handle mass [kg] that the motors compensate, for a device without gravity "
                     "compensation; `palpate doctor --device` measures it; 0: off (0)");
  command.add_option("--clutch-button", clutch_button_,
                     "clutch: while this button of the device is pressed the HIP stays, 0 to 31");
  command
      .add_option("--limit", limits_,
                  "set a safety limit, NAME=VALUE in SI units; see `palpate parameters`")
      ->allow_extra_args(false);
  command.add_flag(
      "--without-watchdog", without_watchdog_,
      "allow forces above engage_force on a device that has motors but no watchdog of at most 0.5 "
      "s. Danger: if this program is killed, the device keeps the last force");
  command.add_option("--rate", rate_, "ticks per second (1000)");
  command.add_option("--listen", listen_,
                     "address on which the page is served (127.0.0.1: only for this computer). "
                     "Tokens are sent unencrypted over the network: a tunnel from the other "
                     "computer is safer, ssh -L 8642:localhost:8642 THIS_COMPUTER");
  command.add_option("--port", port_, "port of the page (8642, or any if that is in use; 0: any)")
      ->check(CLI::Range(0, 65535));
  command
      .add_option("--token", token_,
                  "access token for viewing and for controlling the HIP; generated if --listen "
                  "allows other computers")
      ->envname("PALPATE_TOKEN");
  command
      .add_option(
          "--operator-token", operator_token_,
          "access token of the operator: only a page with this token can change method, placement "
          "and limits, and record. If omitted, it is generated and printed. Other users of this "
          "computer can read the command line; use the environment variable instead")
      ->envname("PALPATE_OPERATOR_TOKEN");
  command
      .add_option("--operator-limit", operator_limits_,
                  "least strict value that the operator may set for a safety limit on the page, "
                  "NAME=VALUE in SI units (the end of its range)")
      ->allow_extra_args(false);
  command.add_flag("--no-browser", no_browser_,
                   "print the address of the page, but do not open a browser");
  command.add_option(
      "--record", record_,
      "record the session into this folder as a ROS 2 bag; check it with palpate replay");
  command.add_option("--record-folder", record_folder_,
                     "folder for recordings started on the page (the current folder)");
  command.add_option("--record-limit", record_limit_,
                     "total size [GB] of the recordings started on the page; recording ends there, "
                     "or when less than 1 GB is free (20)");
  method_.add_to(command);
  command.get_option("--config")->description("read the session from a TOML file");
}

bool SessionArguments::names_cameras() const {
  return !cameras_.empty() || method_.has_file();
}

SessionConfig SessionArguments::config(const MethodRegistry& methods) const {
  SessionConfig config = method_.session(methods);
  if (!cameras_.empty()) config.cameras = chosen(cameras_, config.cameras);
  for (CameraSpec& camera : config.cameras)
    camera.uri = with_material(source_uri(camera.uri, all_sources()), material_);
  if (!devices_.empty()) {
    // Of a hand that the file knows, all but where it is plugged in stays.
    config.hands.resize(devices_.size());
    for (std::size_t i = 0; i < devices_.size(); ++i) config.hands[i].device = devices_[i];
  }
  for (HandSpec& hand : config.hands) {
    if (!hand.device.empty()) hand.device = all_devices().with_scheme(hand.device);
  }
  Placement& placement = config.hands.front().placement;
  if (bubble_) placement.bubble_radius = *bubble_;
  if (handle_weight_) placement.handle_weight = *handle_weight_;
  apply_placement(device_pose_, scale_, clutch_button_, placement);
  for (const std::string& limit : limits_) {
    const auto [name, value] = parse_assignment("--limit", limit);
    set_parameter(config.safety, name, value);
  }
  if (without_watchdog_) config.without_watchdog = true;
  if (rate_) config.rate = *rate_;
  for (const std::string& limit : operator_limits_) {
    const auto [name, value] = parse_assignment("--operator-limit", limit);
    SafetyParameters checked;
    set_parameter(checked, name, value);
    config.operator_limits[name] = value;
  }
  if (fixtures_) config.fixtures = *fixtures_;
  if (record_) config.record = *record_;
  if (record_folder_) config.record_folder = *record_folder_;
  if (record_limit_) config.record_limit = *record_limit_;
  if (listen_) config.server.listen = *listen_;
  if (port_) config.server.port = static_cast<std::uint16_t>(*port_);
  if (token_) config.server.token = *token_;
  if (operator_token_) config.server.operator_token = *operator_token_;
  if (no_browser_) config.server.browser = false;
  validate(config);
  return config;
}

}  // namespace palpate::app
