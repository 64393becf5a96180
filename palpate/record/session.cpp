// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/session.hpp"

#include <utility>

#include <nlohmann/json.hpp>

#include "palpate/io/sources/fixture_file.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"

namespace palpate {
namespace {

using nlohmann::json;

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

// A tool's points, so that a replay needs no mesh.
json tool_json(const ToolShape& tool) {
  json numbers = json::array();
  for (const ToolShape::Point& point : tool.points())
    for (const Vec3* v : {&point.at, &point.inward})
      for (int axis = 0; axis < 3; ++axis) numbers.push_back((*v)[axis]);
  return {{"text", tool.text()}, {"turning", tool.turning()}, {"points", numbers}};
}

std::shared_ptr<const ToolShape> tool_from_json(const json& object) {
  const auto numbers = object.at("points").get<std::vector<double>>();
  std::vector<ToolShape::Point> points(numbers.size() / 6);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double* n = numbers.data() + 6 * i;
    points[i] = {Vec3(n[0], n[1], n[2]), Vec3(n[3], n[4], n[5]), 0};
  }
  return std::make_shared<const ToolShape>(std::move(points), object.at("text").get<std::string>(),
                                           object.at("turning").get<double>());
}

}  // namespace

std::vector<double> row_of(const AdoptedFrame& frame) {
  std::vector<double> row{static_cast<double>(frame.number), frame.stamp, frame.put_at};
  for (std::size_t i = 0; i < frame.camera_count; ++i)
    row.insert(row.end(), {static_cast<double>(frame.cameras[i].camera), frame.cameras[i].stamp});
  row.push_back(static_cast<double>(frame.tick));
  return row;
}

AdoptedFrame adopted_of(std::span<const double> row, const std::string& name) {
  constexpr std::size_t fixed = 4;
  if (row.size() < fixed + 2 || row.size() > fixed + 2 * Freshness::max_cameras ||
      row.size() % 2 != fixed % 2)
    throw Error(name, "has " + std::to_string(row.size()) + " numbers", "it may be damaged");
  AdoptedFrame frame;
  GetNumbers get(row, name);
  get("number", frame.number);
  get("stamp", frame.stamp);
  get("put_at", frame.put_at);
  frame.camera_count = (row.size() - fixed) / 2;
  for (CameraFrame& camera : std::span(frame.cameras).first(frame.camera_count)) {
    get("camera", camera.camera);
    get("stamp", camera.stamp);
  }
  get("tick", frame.tick);
  return frame;
}

std::filesystem::path hand_folder(const std::filesystem::path& first, const std::string& hand) {
  return first / hand;
}

std::string to_json(const SessionInfo& info) {
  json object = {{"palpate", info.version},
                 {"cameras", info.cameras},
                 {"device", info.device},
                 {"device_limits",
                  {{"max_force", info.limits.max_force},
                   {"continuous_force", info.limits.continuous_force},
                   {"max_torque", info.limits.max_torque}}},
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
                   .continuous_force = limits.at("continuous_force").get<double>(),
                   .max_torque = limits.at("max_torque").get<double>()};
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
  if (all.tool) object["tool"] = tool_json(*all.tool);
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
    all.placement.bubble_radius = object.at("bubble_radius").get<double>();
    all.placement.bubble_speed = object.at("bubble_speed").get<double>();
    all.placement.handle_weight = object.at("handle_weight").get<double>();
    for (int axis = 0; axis < 3; ++axis)
      all.placement.down[axis] = object.at("down").at(static_cast<std::size_t>(axis)).get<double>();
    commands.scene = whole_of<std::uint64_t>(object.at("scene"), name);
    commands.hold = object.at("hold").get<bool>();
    if (object.contains("tool")) all.tool = tool_from_json(object.at("tool"));
    if (object.contains("fixtures"))
      all.fixtures = fixtures_from_json(object.at("fixtures").dump(), name);
    validate(all);
    return commands;
  });
}

}  // namespace palpate
