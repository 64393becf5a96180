// SPDX-License-Identifier: Apache-2.0
#include "app/options.hpp"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <type_traits>

#include <fmt/format.h>

#include "app/program.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/kernel/methods/methods.hpp"

namespace palpate::app {

void check_method(const MethodRegistry& methods, const std::string& name) {
  try {
    static_cast<void>(methods.find(name));
  } catch (const Error& error) {
    throw UnknownMethod(error);
  }
}

double parse_number(const std::string& subject, const std::string& text) {
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || rest != end)
    throw Error(subject, "'" + text + "' is not a number", "give a number such as 0.005");
  return value;
}

std::string with_material(const std::string& uri, const std::optional<std::string>& material) {
  if (!material || Uri(uri).has("material")) return uri;
  if (material->find_first_of("&?") != std::string::npos)
    throw Error("--material " + *material, "a name with & or ? cannot stand in a camera's URI",
                "rename the file");
  const bool begun = uri.find('?') != std::string::npos;
  return uri + (begun ? (uri.back() == '?' ? "" : "&") : "?") + "material=" + *material;
}

void MethodOptions::add_to(CLI::App& command) {
  command.add_option("--method", method_,
                     "sight (the default), paper, or any other that `palpate methods` lists");
  add_parameters_to(command);
}

void MethodOptions::add_parameters_to(CLI::App& command) {
  add_repeated(command, "--set", assignments_,
               "set a parameter, NAME=VALUE in SI units; see `palpate parameters`");
  command.add_option("--config", config_,
                     "read the method and parameters from a session's TOML file");
}

std::pair<std::string, double> parse_assignment(const std::string& option,
                                                const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos)
    throw Error(option + " " + text, "there is no '='", "write " + option + " NAME=VALUE");
  const std::string name = text.substr(0, equals);
  return {name, parse_number(option + " " + name, text.substr(equals + 1))};
}

SessionConfig MethodOptions::session(const MethodRegistry& methods) const {
  SessionConfig config;
  config.method = default_method;
  const auto check = [&methods](const std::string& name) { check_method(methods, name); };
  if (config_) config = read_session_config(*config_, config, check);
  if (method_) config.method = *method_;
  check(config.method);
  for (const std::string& assignment : assignments_) {
    const auto [name, value] = parse_assignment("--set", assignment);
    set_parameter(config.parameters, name, value);
    config.radii_chosen = config.radii_chosen || is_proxy_radius(name);
  }
  validate(config.parameters);
  return config;
}

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

Eigen::Isometry3d device_pose(const std::string& text) {
  std::error_code unused;
  if (std::filesystem::is_regular_file(text, unused))
    return read_session_config(text).hands.front().placement.world_from_device;
  if (text.find(',') == std::string::npos && text.find(' ') == std::string::npos)
    throw Error("--device-pose " + text, "there is no such file",
                "give x,y,z,qx,qy,qz,qw or the TOML file that palpate calibrate wrote");
  return parse_pose(text, "--device-pose");
}

// Calls way(key, member) for the keys with an option: of the session, its first hand, the server.
template <class Way>
void walk_options(SessionConfig& config, const Way& way) {
  const auto if_option = [&](const Key& key, auto& value) {
    if constexpr (!std::is_same_v<decltype(value), Eigen::Isometry3d&>) {
      if (!key.option.empty()) way(key, value, std::string(key.option));
    }
  };
  Placement::walk_keys(config.hands.front().placement, if_option);
  SessionConfig::walk_keys(config, if_option);
  ServerConfig::walk_keys(config.server, if_option);
}

std::string help_of(const Key& key) {
  const std::string range = key.min < key.max ? " [" + range_text(key) + "]" : "";
  return std::string(key.meaning) + range;
}

}  // namespace

void SessionArguments::add_to(CLI::App& command) {
  command_ = &command;
  add_repeated(command, "--camera", cameras_,
               "source of the frames (synthetic:desk?noise=1mm); may be given several times; "
               "?pose=x,y,z,qx,qy,qz,qw sets the camera pose");
  command.add_option("--material", material_,
                     "material of the surfaces: wood or another name of `palpate parameters` for "
                     "all of them, or a TOML file that assigns materials by colour or label");
  add_repeated(
      command, "--device", devices_,
      "haptic device: mouse: on the page (the default), hand: a simulated user (the default "
      "with --headless), script:FILE.csv a path; given several times, one hand for each");
  command.add_option(
      "--device-pose", device_pose_,
      "pose of the device in the scene: x,y,z,qx,qy,qz,qw [m], or the TOML file that palpate "
      "calibrate wrote. With several hands, this option and --scale, --bubble, --handle-weight and "
      "--clutch-button are for the first; set those of the others in [[hand]] of --config");
  walk_options(given_, [&](const Key& key, auto& value, const std::string& option) {
    if constexpr (std::is_same_v<decltype(value), bool&>) {
      command.add_flag(option, value, help_of(key));
    } else if constexpr (std::is_same_v<decltype(value), double&>) {
      command.add_option(option, value, fmt::format("{} ({:g})", help_of(key), value));
    } else {
      command.add_option(option, value, help_of(key));
    }
  });
  command.get_option("--token")->envname("PALPATE_TOKEN");
  command.get_option("--operator-token")->envname("PALPATE_OPERATOR_TOKEN");
  command.add_flag("--no-browser", no_browser_,
                   "print the address of the page, but do not open a browser");
  add_repeated(command, "--limit", limits_,
               "set a safety limit, NAME=VALUE in SI units; see `palpate parameters`");
  add_repeated(command, "--operator-limit", operator_limits_,
               "least strict value that the operator may set for a safety limit on the page, "
               "NAME=VALUE in SI units (the end of its range)");
  method_.add_to(command);
  command.get_option("--config")->description("read the session from a TOML file");
}

bool SessionArguments::names_cameras() const { return !cameras_.empty() || method_.has_file(); }

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
  walk_options(config, [&](const Key& key, auto& value, const std::string& option) {
    const CLI::Option& given = *command_->get_option(option);
    if (given.empty()) return;
    given.results(value);
    check(key, value, "option", option);
  });
  if (device_pose_) config.hands.front().placement.world_from_device = device_pose(*device_pose_);
  for (const std::string& limit : limits_) {
    const auto [name, value] = parse_assignment("--limit", limit);
    set_parameter(config.safety, name, value);
  }
  for (const std::string& limit : operator_limits_) {
    const auto [name, value] = parse_assignment("--operator-limit", limit);
    SafetyParameters checked;
    set_parameter(checked, name, value);
    config.operator_limits[name] = value;
  }
  if (no_browser_) config.server.browser = false;
  validate(config);
  return config;
}

}  // namespace palpate::app
