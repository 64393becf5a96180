// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/config.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <span>
#include <sstream>

#include "palpate/io/sources/toml_table.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

constexpr const char* remedy_toml = "write it in TOML, in UTF-8; docs/session.md has an example";
constexpr double lowest_rate = 100.0;  // [Hz]
constexpr double highest_rate = 1e5;
constexpr std::size_t largest_file = 1 << 20;  // [bytes]
constexpr double lowest_record_limit = 0.001;  // [GB]
constexpr double highest_record_limit = 1e6;

CameraSpec read_camera(const TomlTable& root, const toml::node& node) {
  CameraSpec camera;
  if (node.is_string()) {
    camera.uri = **node.as_string();
    return camera;
  }
  if (!node.is_table()) root.fail(node, "a camera is not a table", "write [[camera]] and a uri");
  constexpr std::array<std::string_view, 3> keys{"uri", "name", "world_from_camera"};
  const TomlTable table(*node.as_table(), root.file(), "[[camera]]", keys);
  table.read("uri", camera.uri);
  if (camera.uri.empty()) root.fail(node, "a camera has no 'uri'", "write uri = \"SCHEME:PATH\"");
  table.read("name", camera.name);
  camera.world_from_camera = table.pose("world_from_camera");
  return camera;
}

std::vector<CameraSpec> read_cameras(const TomlTable& root, const toml::node& node) {
  std::vector<CameraSpec> cameras;
  if (const toml::array* array = node.as_array()) {
    for (const toml::node& element : *array) cameras.push_back(read_camera(root, element));
  } else {
    cameras.push_back(read_camera(root, node));
  }
  if (cameras.empty()) root.fail(node, "there is no camera in the list", "name at least one");
  return cameras;
}

constexpr std::array<std::string_view, 9> placement_keys{
    "world_from_device", "scale",  "clutch_button", "bubble_radius", "bubble_speed",
    "handle_weight",     "down_x", "down_y",        "down_z"};

void read_placement(const TomlTable& table, Placement& placement) {
  if (const auto pose = table.pose("world_from_device")) placement.world_from_device = *pose;
  table.read("scale", placement.workspace_scale, 1e-3, 1e3, "scene m per device m");
  double button = -1.0;
  table.read("clutch_button", button, 0.0, 31.0, "", true);
  if (button >= 0.0) placement.clutch_button = static_cast<int>(button);
  table.read("bubble_radius", placement.bubble_radius, 0.0, 1.0, "m, device");
  table.read("bubble_speed", placement.bubble_speed, 1e-3, 1.0, "m/s, scene");
  table.read("handle_weight", placement.handle_weight, 0.0, 0.1, "kg");
  table.read("down_x", placement.down.x(), -1.0, 1.0, "");
  table.read("down_y", placement.down.y(), -1.0, 1.0, "");
  table.read("down_z", placement.down.z(), -1.0, 1.0, "");
}

HandSpec read_hand(const TomlTable& root, const toml::node& node) {
  if (!node.is_table()) root.fail(node, "a hand is not a table", "write [[hand]] and a device");
  constexpr std::array<std::string_view, 2> own_keys{"device", "name"};
  std::array<std::string_view, own_keys.size() + placement_keys.size()> keys;
  std::copy(placement_keys.begin(), placement_keys.end(),
            std::copy(own_keys.begin(), own_keys.end(), keys.begin()));
  const TomlTable table(*node.as_table(), root.file(), "[[hand]]", keys);
  HandSpec hand;
  table.read("device", hand.device);
  if (hand.device.empty())
    root.fail(node, "a hand has no 'device'", "write device = \"SCHEME:PATH\"");
  table.read("name", hand.name);
  read_placement(table, hand.placement);
  return hand;
}

// The hands after the first, which `device` and `placement` describe.
void read_hands(const TomlTable& root, const toml::node& node, std::vector<HandSpec>& hands) {
  hands.resize(1);
  if (const toml::array* array = node.as_array()) {
    for (const toml::node& element : *array) hands.push_back(read_hand(root, element));
  } else {
    hands.push_back(read_hand(root, node));
  }
}

void read_operator_limits(const TomlTable& root, std::map<std::string, double>& limits) {
  const toml::table* sub = root.sub("operator_limits");
  if (sub == nullptr) return;
  SafetyParameters values;
  read_rows(root, "operator_limits", safety_parameter_table(), values);
  for (const SafetyParameterInfo& row : safety_parameter_table()) {
    if (sub->get(row.name) != nullptr) limits[std::string(row.name)] = row.get(values);
  }
}

void read_server(const TomlTable& root, ServerConfig& server) {
  const toml::table* sub = root.sub("server");
  if (sub == nullptr) return;
  constexpr std::array<std::string_view, 5> keys{"listen", "port", "token", "operator_token",
                                                 "browser"};
  const TomlTable table(*sub, root.file(), "[server]", keys);
  table.read("listen", server.listen);
  table.read("token", server.token);
  table.read("operator_token", server.operator_token);
  table.read("browser", server.browser);
  double port = -1.0;
  table.read("port", port, 0.0, 65535.0, "", true);
  if (port >= 0.0) server.port = static_cast<std::uint16_t>(port);
}

std::string toml_text(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      constexpr std::string_view digits = "0123456789abcdef";
      const auto byte = static_cast<unsigned char>(c);
      quoted += std::string("\\u00") + digits[byte >> 4U] + digits[byte & 15U];
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string toml_number(double value) {
  std::string text = shortest(value);
  if (text.find_first_of(".eni") == std::string::npos) text += ".0";
  return text;
}

std::string toml_pose(const Eigen::Isometry3d& pose) {
  return "[" + pose_text(pose) + "]";
}

template <class Row>
std::string row_line(const Row& row, double value) {
  std::string line = std::string(row.name) + " = " + toml_number(value);
  line.resize(std::max<std::size_t>(line.size(), 28), ' ');
  const std::string unit = row.unit == "-" ? "" : std::string(row.unit) + ", ";
  return line + "  # " + unit + shortest(row.min) + " to " + shortest(row.max) + ": " +
         std::string(row.meaning) + "\n";
}

// A key with a comment behind it.
std::string key_line(const std::string& key, const std::string& value, const std::string& comment) {
  return key + " = " + value + "  # " + comment + "\n";
}

// The keys of a placement, a line each.
std::string placement_lines(const Placement& placement) {
  std::string text;
  text += key_line("world_from_device", toml_pose(placement.world_from_device),
                   "x, y, z in m; quaternion x, y, z, w");
  text += key_line("scale", toml_number(placement.workspace_scale),
                   "0.001 to 1000: scene metres per device metre");
  text +=
      placement.clutch_button
          ? key_line("clutch_button", std::to_string(*placement.clutch_button),
                     "0 to 31: the HIP stays while this button is pressed")
          : key_line("# clutch_button", "0", "0 to 31: the HIP stays while this button is pressed");
  text += key_line("bubble_radius", toml_number(placement.bubble_radius),
                   "m of the device, 0 to 1: rate control outside this radius; 0: off");
  text += key_line("bubble_speed", toml_number(placement.bubble_speed),
                   "m/s in the scene, 0.001 to 1: from 2 cm outside this radius on");
  text += key_line("handle_weight", toml_number(placement.handle_weight),
                   "kg, 0 to 0.1: handle mass that the motors compensate; 0: off");
  for (int axis = 0; axis < 3; ++axis)
    text += key_line(std::string("down_") + "xyz"[axis], toml_number(placement.down[axis]),
                     "direction of gravity in the device frame");
  return text;
}

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    lines.emplace_back(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return lines;
}

// Sets a key of [placement] in `lines`, whose TOML is `root`.
void edit(std::vector<std::string>& lines, const toml::table& root, const std::string& name,
          std::string_view key, const std::string& value) {
  const toml::table* placement = root["placement"].as_table();
  const std::string assignment = std::string(key) + " = " + value;
  if (placement == nullptr) {
    if (!lines.empty() && !lines.back().empty()) lines.emplace_back();
    lines.insert(lines.end(), {"[placement]", assignment});
    return;
  }
  const std::size_t table_line = placement->source().begin.line;
  if (placement->is_inline()) {
    throw Error(at_line(name, placement->source().begin.line),
                "an inline table cannot be edited by a program",
                "write [placement] on a separate line, and each key on a line below it");
  }
  const toml::node* node = placement->get(key);
  if (node == nullptr) {
    // Behind the table's header; of `placement.scale = 1` there is none.
    const std::string& header = lines[table_line - 1];
    const bool dotted = header.find_first_not_of(" \t") != header.find('[');
    lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(table_line),
                 dotted ? "placement." + assignment : assignment);
    return;
  }
  // The value may go over several lines; a comment behind it is kept.
  const toml::source_region& at = node->source();
  const std::string& first = lines[at.begin.line - 1];
  const std::string& last = lines[at.end.line - 1];
  const std::size_t equals = first.find('=');
  const std::size_t comment = last.find('#', std::min<std::size_t>(at.end.column - 1, last.size()));
  const std::string edited = first.substr(0, equals + 1) + " " + value +
                             (comment == std::string::npos ? "" : "  " + last.substr(comment));
  const auto begin = lines.begin() + static_cast<std::ptrdiff_t>(at.begin.line - 1);
  lines.erase(begin + 1, lines.begin() + static_cast<std::ptrdiff_t>(at.end.line));
  *begin = edited;
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

}  // namespace

SessionConfig parse_session_config(std::string_view text, const std::string& name,
                                   const SessionConfig& base, const MethodCheck& check_method) {
  const toml::table tree = parse_toml(text, name, remedy_toml);
  constexpr std::array<std::string_view, 15> keys{
      "camera", "device",           "placement", "rate",          "method",       "parameters",
      "safety", "fixtures",         "record",    "record_folder", "record_limit", "operator_limits",
      "server", "without_watchdog", "hand"};
  const TomlTable root(tree, name, "", keys);
  SessionConfig config = base;
  if (const toml::node* cameras = root.find("camera"))
    config.cameras = read_cameras(root, *cameras);
  root.read("device", config.hands.front().device);
  root.read("without_watchdog", config.without_watchdog);
  root.read("rate", config.rate, lowest_rate, highest_rate, "Hz");
  root.read("method", config.method);
  root.read("fixtures", config.fixtures);
  root.read("record", config.record);
  root.read("record_folder", config.record_folder);
  root.read("record_limit", config.record_limit, lowest_record_limit, highest_record_limit, "GB");
  const auto with_line = [&](const toml::node* node, const auto& action) {
    try {
      action();
    } catch (const Error& error) {
      if (node == nullptr) throw;
      throw Error(at_line(name, node->source().begin.line), error.what());
    }
  };
  if (const toml::node* method = root.find("method"); method != nullptr && check_method)
    with_line(method, [&] { check_method(config.method); });
  if (const toml::table* placement = root.sub("placement"))
    read_placement(TomlTable(*placement, root.file(), "[placement]", placement_keys),
                   config.hands.front().placement);
  if (const toml::node* hands = root.find("hand")) read_hands(root, *hands, config.hands);
  read_rows(root, "parameters", parameter_table(), config.parameters);
  if (const toml::table* parameters = root.sub("parameters")) {
    for (const auto& [key, value] : *parameters)
      config.radii_chosen = config.radii_chosen || is_proxy_radius(key.str());
  }
  read_rows(root, "safety", safety_parameter_table(), config.safety);
  read_operator_limits(root, config.operator_limits);
  read_server(root, config.server);
  with_line(root.find("parameters"), [&] { validate(config.parameters); });
  with_line(root.find("safety"), [&] { validate(config.safety); });
  return config;
}

SessionConfig read_session_config(const std::filesystem::path& file, const SessionConfig& base,
                                  const MethodCheck& check_method) {
  const std::string name = file.string();
  std::error_code unused;
  std::ifstream in(file, std::ios::binary);
  if (!in || std::filesystem::is_directory(file, unused))
    throw Error(name, "it cannot be read", "name a TOML file; docs/session.md has an example");
  std::string text(largest_file + 1, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  if (text.size() > largest_file)
    throw Error(name, "it is larger than 1 MiB", "name a TOML file of a session");
  return parse_session_config(text, name, base, check_method);
}

std::string to_toml(const SessionConfig& config) {
  std::string text = "# A palpate session; docs/session.md describes each key.\n";
  text += key_line("method", toml_text(config.method), "how forces are computed");
  text += key_line("rate", toml_number(config.rate), "Hz, 100 to 100000: ticks of the servo loop");
  text += key_line("device", toml_text(config.hands.front().device),
                   "URI of the haptic device; \"\": the default");
  text += key_line("without_watchdog", config.without_watchdog ? "true" : "false",
                   "allow forces above engage_force on a device with motors but no watchdog");
  text +=
      key_line("fixtures", toml_text(config.fixtures), "TOML file of virtual fixtures; \"\": none");
  text += key_line("record", toml_text(config.record), "folder to record into; \"\": none");
  text += key_line("record_folder", toml_text(config.record_folder),
                   "folder of recordings started on the page; \"\": the current folder");
  text += key_line("record_limit", toml_number(config.record_limit),
                   "GB, 0.001 to 1000000: total of the recordings started on the page");
  for (const CameraSpec& camera : config.cameras) {
    text += "\n[[camera]]\n";
    text += "uri = " + toml_text(camera.uri) + "\n";
    if (!camera.name.empty()) text += "name = " + toml_text(camera.name) + "\n";
    const std::string comment = "x, y, z in m; quaternion x, y, z, w";
    if (camera.world_from_camera) {
      text += key_line("world_from_camera", toml_pose(*camera.world_from_camera), comment);
    } else {
      text += key_line("# world_from_camera", "[0, 0, 0, 0, 0, 0, 1]", comment);
    }
  }
  text += "\n[placement]\n" + placement_lines(config.hands.front().placement);
  for (const HandSpec& hand : std::span(config.hands).subspan(1)) {
    text += "\n[[hand]]\n";
    text += key_line("device", toml_text(hand.device), "URI of a further haptic device");
    if (!hand.name.empty()) text += "name = " + toml_text(hand.name) + "\n";
    text += placement_lines(hand.placement);
  }
  text += "\n[parameters]\n";
  for (const ParameterInfo& row : parameter_table()) {
    // r_c is derived from the radii below it: setting it scales them. Those that nobody chose are
    // left to what is seen.
    const double value = row.get(config.parameters);
    const std::string line = row_line(row, value);
    const bool is_left = row.name == "r_c" || (is_proxy_radius(row.name) && !config.radii_chosen &&
                                               value == row.default_value);
    text += is_left ? "# " + line : line;
  }
  text += "\n[safety]\n";
  for (const SafetyParameterInfo& row : safety_parameter_table())
    text += row_line(row, row.get(config.safety));
  if (!config.operator_limits.empty()) {
    text += "\n[operator_limits]\n";
    for (const auto& [name, value] : config.operator_limits)
      text += key_line(name, toml_number(value), "least strict value that the operator may set");
  }
  text += "\n[server]\n";
  text +=
      key_line("listen", toml_text(config.server.listen), "address on which the page is served");
  text += config.server.port
              ? key_line("port", std::to_string(*config.server.port), "0 to 65535; 0: any")
              : key_line("# port", "8642", "0 to 65535; 0: any");
  text += key_line("token", toml_text(config.server.token), "access token of the page; \"\": none");
  text += key_line("operator_token", toml_text(config.server.operator_token),
                   "access token of the operator; \"\": generated");
  text +=
      key_line("browser", config.server.browser ? "true" : "false", "open a browser at the start");
  return text;
}

std::string with_placement(std::string_view text, const std::string& name,
                           const Placement& placement) {
  validate(placement);
  Placement wanted = parse_session_config(text, name).hands.front().placement;
  std::vector<std::string> lines = lines_of(text);
  edit(lines, parse_toml(text, name, remedy_toml), name, "world_from_device",
       toml_pose(placement.world_from_device));
  std::string edited = joined(lines);
  const bool scale_matters = placement.workspace_scale != wanted.workspace_scale;
  if (scale_matters) {
    edit(lines, parse_toml(edited, name, remedy_toml), name, "scale",
         toml_number(placement.workspace_scale));
    edited = joined(lines);
  }
  // What was written must be what is read, and nothing else may have changed.
  const Placement got = parse_session_config(edited, name).hands.front().placement;
  wanted.workspace_scale = placement.workspace_scale;
  const bool right = got.workspace_scale == placement.workspace_scale &&
                     got.clutch_button == wanted.clutch_button &&
                     got.world_from_device.isApprox(placement.world_from_device, 1e-12);
  if (!right) {
    throw Error(name, "its [placement] is written in a way that a program cannot edit",
                "write [placement] on a separate line, and each key on a line below it");
  }
  return edited;
}

void validate(const SessionConfig& config) {
  for (const CameraSpec& camera : config.cameras) {
    if (camera.world_from_camera)
      check_rigid(*camera.world_from_camera, "world_from_camera of " + camera.uri);
  }
  for (const HandSpec& hand : config.hands) validate(hand.placement);
  validate(config.parameters);
  validate(config.safety);
  if (!(config.rate >= lowest_rate && config.rate <= highest_rate)) {
    throw Error("rate", shortest(config.rate) + " Hz is out of range", "give 100 to 100000 Hz");
  }
  if (!(config.record_limit >= lowest_record_limit &&
        config.record_limit <= highest_record_limit)) {
    throw Error("record_limit", shortest(config.record_limit) + " GB is out of range",
                "give 0.001 to 1000000 GB");
  }
}

}  // namespace palpate
