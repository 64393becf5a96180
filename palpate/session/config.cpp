// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/config.hpp"

#include <algorithm>
#include <fstream>
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
constexpr const char* remedy_placement =
    "write [placement] on a separate line, and each key on a line below it";
constexpr std::size_t largest_file = 1 << 20;  // [bytes]

// Adds the tables of an array, or the one that stands alone; a text is the URI of an item.
template <class Item>
void read_items(const TomlTable& root, const std::string& noun, std::string_view uri_key,
                std::string Item::*uri, std::vector<Item>& items) {
  const auto read = [&](const toml::node& node) {
    Item& item = items.emplace_back();
    if (node.is_string()) {
      item.*uri = **node.as_string();
    } else if (node.is_table()) {
      read_keys(*node.as_table(), root.file(), "[[" + noun + "]]", item);
    } else {
      root.fail(node, "a " + noun + " is not a table",
                "write [[" + noun + "]] and a " + std::string(uri_key));
    }
    if ((item.*uri).empty())
      root.fail(node, "a " + noun + " has no " + TomlTable::quoted(uri_key),
                "write " + std::string(uri_key) + " = \"SCHEME:PATH\"");
  };
  const toml::node* node = root.find(noun);
  if (node == nullptr) return;
  const toml::array* array = node->as_array();
  if (array == nullptr) return read(*node);
  for (const toml::node& element : *array) read(element);
}

void read_operator_limits(const TomlTable& root, std::map<std::string, double>& limits) {
  SafetyParameters checked;
  read_rows(root, "operator_limits", safety_parameter_table(), checked);
  if (const toml::table* given = root.sub("operator_limits")) {
    for (const auto& [name, value] : *given) limits[std::string(name.str())] = value.value_or(0.0);
  }
}

template <class Owner>
void read_table(const TomlTable& root, const std::string& name, Owner& owner) {
  if (const toml::table* table = root.sub(name))
    read_keys(*table, root.file(), "[" + name + "]", owner);
}

std::string toml(std::string_view text) {
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

std::string toml(bool value) { return value ? "true" : "false"; }

std::string toml(double value) {
  std::string text = shortest(value);
  if (text.find_first_of(".eni") == std::string::npos) text += ".0";
  return text;
}

std::string toml(const Eigen::Isometry3d& pose) { return "[" + pose_text(pose) + "]"; }

std::string toml(const std::optional<int>& value) { return std::to_string(value.value_or(0)); }

std::string toml(const std::optional<Eigen::Isometry3d>& pose) {
  return toml(pose.value_or(Eigen::Isometry3d::Identity()));
}

// A line of a file: a key or a row of a table, and in a comment what is known of it.
template <class Row>
std::string line_of(const Row& row, const std::string& value) {
  std::string line = std::string(row.name) + " = " + value;
  line.resize(std::max<std::size_t>(line.size(), 28), ' ');
  const std::string range = row.min < row.max ? range_text(row) + ": " : "";
  return line + "  # " + range + std::string(row.meaning) + "\n";
}

// The keys of `owner`, a line each; behind # where there is no value.
template <class Owner>
std::string lines_of_keys(const Owner& owner) {
  std::string text;
  Owner::walk_keys(owner, [&](const Key& key, const auto& value) {
    if constexpr (requires { value.has_value(); }) text += value ? "" : "# ";
    text += line_of(key, toml(value));
  });
  return text;
}

// The text of a TOML file with another value of a key of [placement], and all else as it is.
std::string with_key(const std::string& text, const std::string& name, std::string_view key,
                     const std::string& value) {
  const toml::table root = parse_toml(text, name, remedy_toml);
  const toml::table* placement = root["placement"].as_table();
  const toml::node* node = placement == nullptr ? nullptr : placement->get(key);
  std::string assignment = std::string(key) + " = " + value;
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  if (placement == nullptr) {
    if (!lines.empty() && !lines.back().empty()) lines.emplace_back();
    lines.insert(lines.end(), {"[placement]", assignment});
  } else if (placement->is_inline()) {
    throw Error(at_line(name, placement->source().begin.line),
                "an inline table cannot be edited by a program", remedy_placement);
  } else if (node == nullptr) {
    // Behind the table's header; of `placement.scale = 1` there is none.
    const std::size_t table_line = placement->source().begin.line;
    const std::string& header = lines[table_line - 1];
    const bool dotted = header.find_first_not_of(" \t") != header.find('[');
    lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(table_line),
                 dotted ? "placement." + assignment : assignment);
  } else {
    // The value may go over several lines; a comment behind it is kept.
    const toml::source_region& at = node->source();
    std::string& first = lines[at.begin.line - 1];
    const std::string& last = lines[at.end.line - 1];
    const std::size_t comment =
        last.find('#', std::min<std::size_t>(at.end.column - 1, last.size()));
    first = first.substr(0, first.find('=') + 1) + " " + value +
            (comment == std::string::npos ? "" : "  " + last.substr(comment));
    lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(at.begin.line),
                lines.begin() + static_cast<std::ptrdiff_t>(at.end.line));
  }
  std::string edited;
  for (const std::string& line : lines) edited += line + "\n";
  return edited;
}

}  // namespace

SessionConfig parse_session_config(std::string_view text, const std::string& name,
                                   const SessionConfig& base, const MethodCheck& check_method) {
  const toml::table tree = parse_toml(text, name, remedy_toml);
  SessionConfig config = base;
  const TomlTable root = read_keys(
      tree, name, "", config,
      {"camera", "placement", "hand", "parameters", "safety", "operator_limits", "server"});
  if (const toml::node* cameras = root.find("camera")) {
    config.cameras.clear();
    read_items(root, "camera", "uri", &CameraSpec::uri, config.cameras);
    if (config.cameras.empty())
      root.fail(*cameras, "there is no camera in the list", "name at least one");
  }
  if (const toml::node* method = root.find("method"); method != nullptr && check_method)
    root.at(*method, [&] { check_method(config.method); });
  read_table(root, "placement", config.hands.front().placement);
  if (root.find("hand") != nullptr) config.hands.resize(1);
  read_items(root, "hand", "device", &HandSpec::device, config.hands);
  read_rows(root, "parameters", parameter_table(), config.parameters);
  read_rows(root, "safety", safety_parameter_table(), config.safety);
  read_operator_limits(root, config.operator_limits);
  read_table(root, "server", config.server);
  if (const toml::table* parameters = root.sub("parameters")) {
    for (const auto& [key, value] : *parameters)
      config.radii_chosen = config.radii_chosen || is_proxy_radius(key.str());
    root.at(*parameters, [&] { validate(config.parameters); });
  }
  if (const toml::table* safety = root.sub("safety"))
    root.at(*safety, [&] { validate(config.safety); });
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
  text += lines_of_keys(config);
  for (const CameraSpec& camera : config.cameras) text += "\n[[camera]]\n" + lines_of_keys(camera);
  text += "\n[placement]\n" + lines_of_keys(config.hands.front().placement);
  for (const HandSpec& hand : std::span(config.hands).subspan(1))
    text += "\n[[hand]]\n" + lines_of_keys(hand);
  text += "\n[parameters]\n";
  for (const ParameterInfo& row : parameter_table()) {
    // r_c is derived from the radii below it: setting it scales them. Those that nobody chose are
    // left to what is seen.
    const double value = row.get(config.parameters);
    const bool is_left = row.name == "r_c" || (is_proxy_radius(row.name) && !config.radii_chosen &&
                                               value == row.default_value);
    text += (is_left ? "# " : "") + line_of(row, toml(value));
  }
  text += "\n[safety]\n";
  for (const SafetyParameterInfo& row : safety_parameter_table())
    text += line_of(row, toml(row.get(config.safety)));
  if (!config.operator_limits.empty()) text += "\n[operator_limits]\n";
  for (const auto& [name, value] : config.operator_limits)
    text += line_of(Key{name, "", "least strict value that the operator may set"}, toml(value));
  return text + "\n[server]\n" + lines_of_keys(config.server);
}

std::string with_placement(std::string_view text, const std::string& name,
                           const Placement& placement) {
  validate(placement);
  Placement wanted = parse_session_config(text, name).hands.front().placement;
  std::string edited =
      with_key(std::string(text), name, "world_from_device", toml(placement.world_from_device));
  if (placement.workspace_scale != wanted.workspace_scale)
    edited = with_key(edited, name, Placement::scale_key.name, toml(placement.workspace_scale));
  // What was written must be what is read, and nothing else may have changed.
  const Placement got = parse_session_config(edited, name).hands.front().placement;
  wanted.workspace_scale = placement.workspace_scale;
  const bool right = got.workspace_scale == placement.workspace_scale &&
                     got.clutch_button == wanted.clutch_button &&
                     got.world_from_device.isApprox(placement.world_from_device, 1e-12);
  if (!right) {
    throw Error(name, "its [placement] is written in a way that a program cannot edit",
                remedy_placement);
  }
  return edited;
}

void validate(const SessionConfig& config) {
  check_keys(config);
  check_keys(config.server);
  for (const CameraSpec& camera : config.cameras) check_keys(camera);
  for (const HandSpec& hand : config.hands) validate(hand.placement);
  validate(config.parameters);
  validate(config.safety);
}

}  // namespace palpate
