// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/session.hpp"

#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include <nlohmann/json.hpp>

#include "palpate/io/sources/fixture_file.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

using nlohmann::json;

// One walk over a tick's fields names, writes and reads them, so that the three cannot differ.
template <class Way, class T>
void walk(Way& way, T& record) {
  auto& tick = record.tick;
  way("t", tick.t);
  way("hip", tick.hip);
  way("proxy", tick.proxy);
  way("normal", tick.normal);
  way("rendered_force", tick.force);
  way("state", tick.state);
  way("steps", tick.steps);
  way("surface_velocity", tick.surface_velocity);
  way("frame", tick.frame);
  way("flags", tick.flags);
  way("force", record.force);
  way("position", record.position);
  way("gain", record.gain);
  way("frame_stamp", record.frame_stamp);
  way("frame_age", record.frame_age);
  way("number", record.number);
  way("frame_number", record.frame_number);
  way("settings_number", record.settings_number);
  way("safety", record.safety);
  way("wake_up_ns", record.wake_up_ns);
  way("previous_compute_ns", record.previous_compute_ns);
  way("hand", record.hand);
  way("surface_motion", tick.surface_motion);
  const auto walk_port = [&way](const std::string& name, auto& port) {
    way(name + "_excess", port.excess);
    way(name + "_most", port.most);
    way(name + "_made", port.made);
    way(name + "_generating", port.generating);
  };
  walk_port("relative", record.energy.relative);
  walk_port("absolute", record.energy.absolute);
  way("contacts", record.energy.contacts);
  way("region", record.region);
  way("guidance", record.guidance);
  way("fixtures", record.fixtures);
  way("handle", record.handle);
  way("orientation", tick.orientation);
  way("proxy_orientation", tick.proxy_orientation);
  way("rendered_torque", tick.torque);
  way("torque", record.torque);
}

// The axes of a field's numbers; a single number has no axis.
template <class T>
constexpr std::string_view axes_of{};
template <>
constexpr std::string_view axes_of<Vec3> = "xyz";
template <>
constexpr std::string_view axes_of<Rotation> = "xyzw";  // as a rotation's coeffs()

class Names {
 public:
  template <class T>
  void operator()(std::string_view name, const T& /*value*/) {
    if constexpr (axes_of<T>.empty()) names.emplace_back(name);
    for (const char axis : axes_of<T>) names.push_back(std::string(name) + "_" + axis);
  }
  std::vector<std::string> names;
};

class Put {
 public:
  void operator()(std::string_view /*name*/, const Vec3& v) {
    row.insert(row.end(), v.begin(), v.end());
  }
  void operator()(std::string_view /*name*/, const Rotation& q) {
    row.insert(row.end(), q.coeffs().begin(), q.coeffs().end());
  }
  template <class T>
  void operator()(std::string_view /*name*/, const T& value) {
    row.push_back(static_cast<double>(value));  // whole numbers are far below 2^53
  }
  std::vector<double> row;
};

class Get {
 public:
  Get(std::span<const double> row, std::span<const std::optional<std::size_t>> places,
      const std::string& name)
      : row_(row), places_(places), name_(name) {}

  void operator()(std::string_view /*field*/, double& value) { value = next().value_or(value); }
  void operator()(std::string_view /*field*/, Vec3& v) {
    for (double& value : v) value = next().value_or(value);
  }
  void operator()(std::string_view /*field*/, Rotation& q) {
    for (double& value : q.coeffs()) value = next().value_or(value);
  }
  template <class T>
  void operator()(std::string_view field, T& value) {
    const std::optional<double> number = next();
    if (!number) return;
    if constexpr (std::is_enum_v<T>) {
      value = static_cast<T>(static_cast<int>(whole(field, *number, 0.0, 2.0)));
    } else {
      constexpr double most = 9007199254740992.0;  // 2^53
      using Limits = std::numeric_limits<T>;
      value =
          static_cast<T>(whole(field, *number, std::max(static_cast<double>(Limits::min()), -most),
                               std::min(static_cast<double>(Limits::max()), most)));
    }
  }

 private:
  std::optional<double> next() {
    const std::optional<std::size_t> place = places_[at_++];
    return place ? std::optional(row_[*place]) : std::nullopt;
  }
  [[nodiscard]] double whole(std::string_view field, double value, double least,
                             double most) const {
    if (!(value >= least && value <= most && value == std::floor(value)))
      throw Error(name_, "has a " + std::string(field) + " of " + std::to_string(value),
                  "it may be damaged");
    return value;
  }

  std::span<const double> row_;
  std::span<const std::optional<std::size_t>> places_;
  const std::string& name_;
  std::size_t at_ = 0;
};

// A whole number that a T can hold; JSON's own may have fractions or be of any size.
template <class T>
T whole_of(const json& number, const std::string& name) {
  const bool fits = number.is_number_unsigned() ? std::in_range<T>(number.get<std::uint64_t>())
                                                : number.is_number_integer() &&
                                                      std::in_range<T>(number.get<std::int64_t>());
  if (!fits)
    throw Error(name, "has a number that is not whole or too large",
                "it may be damaged, or of another version of palpate");
  return number.get<T>();
}

// Calls `read` with the JSON in `text`; whatever does not fit is an Error about `name`.
template <class Read>
auto parsed(const std::string& text, const std::string& name, const Read& read) {
  try {
    return read(json::parse(text));
  } catch (const json::exception& error) {
    throw Error(name, error.what(), "it may be damaged, or of another version of palpate");
  }
}

}  // namespace

const std::vector<std::string>& tick_columns() {
  static const std::vector<std::string> columns = [] {
    Names names;
    const ServoTick tick;
    walk(names, tick);
    return std::move(names.names);
  }();
  return columns;
}

std::vector<double> row_of(const ServoTick& tick) {
  Put put;
  put.row.reserve(tick_columns().size());
  walk(put, tick);
  return std::move(put.row);
}

TickRows::TickRows(std::span<const std::string> columns) : width_(columns.size()) {
  for (const std::string& name : tick_columns()) {
    const auto found = std::find(columns.begin(), columns.end(), name);
    places_.push_back(found == columns.end() ? std::nullopt
                                             : std::optional<std::size_t>(found - columns.begin()));
  }
}

ServoTick TickRows::read(std::span<const double> row, const std::string& name) const {
  if (row.size() != width_)
    throw Error(
        name, "has " + std::to_string(row.size()) + " numbers instead of " + std::to_string(width_),
        "it may be damaged");
  ServoTick tick;
  Get get(row, places_, name);
  walk(get, tick);
  return tick;
}

std::vector<double> row_of(const AdoptedFrame& frame) {
  std::vector<double> row{static_cast<double>(frame.number), frame.stamp, frame.put_at};
  for (std::size_t i = 0; i < frame.camera_count; ++i)
    row.insert(row.end(), {static_cast<double>(frame.cameras[i].camera), frame.cameras[i].stamp});
  if (frame.tick) row.push_back(static_cast<double>(*frame.tick));
  return row;
}

AdoptedFrame adopted_of(std::span<const double> row, const std::string& name) {
  constexpr std::size_t fixed = 3;
  constexpr double most = 9007199254740992.0;  // 2^53
  const auto whole = [&](double value) {
    if (!(value >= 0.0 && value <= most && value == std::floor(value)))
      throw Error(name, "has a number of " + std::to_string(value), "it may be damaged");
    return static_cast<std::uint64_t>(value);
  };
  if (row.size() < fixed || row.size() > fixed + 2 * Freshness::max_cameras + 1)
    throw Error(name, "has " + std::to_string(row.size()) + " numbers", "it may be damaged");
  AdoptedFrame frame{.number = whole(row[0]), .stamp = row[1], .put_at = row[2]};
  if (row.size() % 2 != fixed % 2) frame.tick = whole(row.back());
  for (std::size_t i = fixed; i + 1 < row.size(); i += 2)
    frame.cameras[frame.camera_count++] = {.camera = whole(row[i]), .stamp = row[i + 1]};
  return frame;
}

std::filesystem::path hand_folder(const std::filesystem::path& first, const std::string& hand) {
  return first / hand;
}

std::string to_json(const SessionInfo& info) {
  json object = {
      {"palpate", info.version},
      {"cameras", info.cameras},
      {"device", info.device},
      {"device_limits",
       {{"max_force", info.limits.max_force}, {"continuous_force", info.limits.continuous_force}}},
      {"epoch_ns", info.epoch},
      {"tick_columns", tick_columns()}};
  if (!info.hand.empty()) object["hand"] = info.hand;
  if (!info.more_hands.empty()) object["more_hands"] = info.more_hands;
  if (info.frames_in_parent) object["frames_in_parent"] = true;
  return object.dump(-1, ' ', false, json::error_handler_t::replace);
}

SessionInfo session_from_json(const std::string& text, const std::string& name) {
  return parsed(text, name, [&](const json& object) {
    SessionInfo info;
    info.version = object.at("palpate").get<std::string>();
    info.cameras = object.at("cameras").get<std::vector<std::string>>();
    info.device = object.at("device").get<std::string>();
    info.epoch = whole_of<std::int64_t>(object.at("epoch_ns"), name);
    const json& limits = object.at("device_limits");
    info.limits = {.max_force = limits.at("max_force").get<double>(),
                   .continuous_force = limits.at("continuous_force").get<double>()};
    info.tick_columns = object.at("tick_columns").get<std::vector<std::string>>();
    info.hand = object.value("hand", std::string());
    info.more_hands = object.value("more_hands", std::vector<std::string>());
    for (const std::string& hand : info.more_hands) {
      if (hand.empty() || hand.find_first_of("./\\") != std::string::npos)
        throw Error(name, "has a hand '" + hand + "'", "it may be damaged");
    }
    info.frames_in_parent = object.value("frames_in_parent", false);
    return info;
  });
}

std::string to_json(const ServoCommands& commands) {
  const ServoSettings& all = commands.settings;
  json parameters;
  json safety;
  json pose = json::array();
  for (const ParameterInfo& row : parameter_table()) parameters[row.name] = row.get(all.parameters);
  for (const SafetyParameterInfo& row : safety_parameter_table())
    safety[row.name] = row.get(all.safety);
  for (int i = 0; i < 12; ++i) pose.push_back(all.placement.world_from_device(i / 4, i % 4));
  json object = {{"number", commands.number},
                 {"method", all.method},
                 {"parameters", parameters},
                 {"safety", safety},
                 {"world_from_device", pose},
                 {"workspace_scale", all.placement.workspace_scale},
                 {"bubble_radius", all.placement.bubble_radius},
                 {"bubble_speed", all.placement.bubble_speed},
                 {"handle_weight", all.placement.handle_weight},
                 {"down", {all.placement.down.x(), all.placement.down.y(), all.placement.down.z()}},
                 {"scene", commands.scene},
                 {"hold", commands.hold}};
  if (all.placement.clutch_button) object["clutch_button"] = *all.placement.clutch_button;
  if (all.fixtures) object["fixtures"] = json::parse(fixtures_json(*all.fixtures));
  return object.dump();
}

ServoCommands commands_from_json(const std::string& text, const std::string& name) {
  return parsed(text, name, [&](const json& object) {
    ServoCommands commands;
    ServoSettings& all = commands.settings;
    commands.number = whole_of<std::uint64_t>(object.at("number"), name);
    all.method = object.at("method").get<std::string>();
    const json& parameters = object.at("parameters");
    for (const ParameterInfo& row : parameter_table()) {
      // r_c is derived: setting it would round the three radii that it scales. What an older
      // version did not have yet stays at its default.
      if (row.name != "r_c" && parameters.contains(row.name))
        set_parameter(all.parameters, row.name, parameters.at(row.name).get<double>());
    }
    const json& safety = object.at("safety");
    for (const SafetyParameterInfo& row : safety_parameter_table()) {
      if (safety.contains(row.name))
        set_parameter(all.safety, row.name, safety.at(row.name).get<double>());
    }
    const json& pose = object.at("world_from_device");
    for (int i = 0; i < 12; ++i)
      all.placement.world_from_device(i / 4, i % 4) =
          pose.at(static_cast<std::size_t>(i)).get<double>();
    all.placement.workspace_scale = object.at("workspace_scale").get<double>();
    if (object.contains("clutch_button"))
      all.placement.clutch_button = whole_of<int>(object.at("clutch_button"), name);
    all.placement.bubble_radius = object.value("bubble_radius", all.placement.bubble_radius);
    all.placement.bubble_speed = object.value("bubble_speed", all.placement.bubble_speed);
    all.placement.handle_weight = object.value("handle_weight", all.placement.handle_weight);
    if (object.contains("down")) {
      for (int axis = 0; axis < 3; ++axis)
        all.placement.down[axis] =
            object.at("down").at(static_cast<std::size_t>(axis)).get<double>();
    }
    if (object.contains("scene"))
      commands.scene = whole_of<std::uint64_t>(object.at("scene"), name);
    commands.hold = object.value("hold", false);
    if (object.contains("fixtures"))
      all.fixtures = fixtures_from_json(object.at("fixtures").dump(), name);
    validate(all);
    return commands;
  });
}

}  // namespace palpate
