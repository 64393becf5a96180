// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/node/node_parameters.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/servo/placement.hpp"
#include "palpate/servo/safety.hpp"

namespace palpate {
namespace {

using ros::ParameterValue;

std::string type_text(std::uint8_t type) {
  switch (type) {
    case ParameterValue::flag:
      return "a flag";
    case ParameterValue::integer:
    case ParameterValue::number:
      return "a number";
    case ParameterValue::text:
      return "a text";
    default:
      return "a list";
  }
}

double number_of(const std::string& name, const ParameterValue& value) {
  if (value.type == ParameterValue::number) return value.double_value;
  if (value.type == ParameterValue::integer) return static_cast<double>(value.integer_value);
  throw Error("parameter '" + name + "'", "it is a number, not " + type_text(value.type),
              "give one, such as 1.5");
}

std::string summary_of(std::string_view meaning, std::string_view unit, double default_value) {
  std::string text(meaning);
  if (unit != "-") text += " [" + std::string(unit) + "]";
  return text + "; default " + number_text(default_value);
}

bool is_within(const std::string& name, const std::string& prefix, std::uint64_t depth) {
  if (!prefix.empty() && name == prefix) return true;
  const std::string begin = prefix.empty() ? "" : prefix + ".";
  if (!name.starts_with(begin)) return false;
  const auto dots =
      std::count(name.begin() + static_cast<std::ptrdiff_t>(begin.size()), name.end(), '.');
  return depth == 0 || static_cast<std::uint64_t>(dots) < depth;
}

}  // namespace

template <class Table, class Part>
void NodeParameters::add_table(const std::string& prefix, const Table& table,
                               Part ServoSettings::*part, bool read_only) {
  for (const auto& row : table) {
    Row made;
    made.descriptor.name = prefix + std::string(row.name);
    made.descriptor.type = ParameterValue::number;
    made.descriptor.description = summary_of(row.meaning, row.unit, row.default_value);
    made.descriptor.read_only = read_only;
    made.descriptor.floating_point_range = {{row.min, row.max, 0.0}};
    made.get = [&row, part](const ServoSettings& settings) {
      return ParameterValue::of(row.get(settings.*part));
    };
    if (!read_only) {
      made.set = [&row, part, name = made.descriptor.name](ServoSettings& settings,
                                                           const ParameterValue& value) {
        const double number = number_of(name, value);
        check_range("parameter", name, row.unit, row.min, row.max, number);
        row.set(settings.*part, number);
      };
    }
    rows_.push_back(std::move(made));
  }
}

NodeParameters::NodeParameters(const MethodRegistry& methods) {
  add_table("", parameter_table(), &ServoSettings::parameters, false);
  add_table("placement.", placement_table(), &ServoSettings::placement, false);
  add_table("safety.", safety_parameter_table(), &ServoSettings::safety, true);
  Row method;
  method.descriptor.name = "method";
  method.descriptor.type = ParameterValue::text;
  method.descriptor.description = "what makes the force";
  for (const MethodInfo& info : methods.entries())
    method.descriptor.additional_constraints +=
        std::string(method.descriptor.additional_constraints.empty() ? "one of " : ", ") +
        std::string(info.name);
  method.get = [](const ServoSettings& settings) { return ParameterValue::of(settings.method); };
  method.set = [](ServoSettings& settings, const ParameterValue& value) {
    if (value.type != ParameterValue::text)
      throw Error("parameter 'method'", "it is a text, not " + type_text(value.type),
                  "give a method's name, such as sight");
    settings.method = value.string_value;
  };
  rows_.push_back(std::move(method));
  std::sort(rows_.begin(), rows_.end(),
            [](const Row& a, const Row& b) { return a.descriptor.name < b.descriptor.name; });
}

const NodeParameters::Row* NodeParameters::find(const std::string& name) const {
  const auto row = std::find_if(rows_.begin(), rows_.end(),
                                [&](const Row& r) { return r.descriptor.name == name; });
  return row == rows_.end() ? nullptr : &*row;
}

std::vector<ros::Parameter> NodeParameters::all(const ServoSettings& settings) const {
  std::vector<ros::Parameter> parameters;
  parameters.reserve(rows_.size());
  for (const Row& row : rows_) parameters.push_back({row.descriptor.name, row.get(settings)});
  return parameters;
}

ros::ParameterValue NodeParameters::get(const ServoSettings& settings,
                                        const std::string& name) const {
  const Row* row = find(name);
  return row == nullptr ? ParameterValue{} : row->get(settings);
}

ros::ParameterDescriptor NodeParameters::describe(const std::string& name) const {
  const Row* row = find(name);
  if (row != nullptr) return row->descriptor;
  ros::ParameterDescriptor unknown;
  unknown.name = name;
  return unknown;
}

ros::ParametersFound NodeParameters::list(const ros::ParametersWithin& within) const {
  const std::vector<std::string>& prefixes = within.prefixes;
  const std::uint64_t depth = within.depth;
  ros::ParametersFound reply;
  for (const Row& row : rows_) {
    const std::string& name = row.descriptor.name;
    const bool is_asked_for =
        prefixes.empty() ? is_within(name, "", depth)
                         : std::any_of(prefixes.begin(), prefixes.end(),
                                       [&](const auto& p) { return is_within(name, p, depth); });
    if (!is_asked_for) continue;
    reply.names.push_back(name);
    const std::size_t dot = name.rfind('.');
    if (dot == std::string::npos) continue;
    const std::string prefix = name.substr(0, dot);
    if (std::find(reply.prefixes.begin(), reply.prefixes.end(), prefix) == reply.prefixes.end())
      reply.prefixes.push_back(prefix);
  }
  return reply;
}

void NodeParameters::set(ServoSettings& settings, const ros::Parameter& parameter) const {
  const Row* row = find(parameter.name);
  if (row == nullptr) {
    std::vector<std::string_view> known;
    for (const Row& each : rows_) known.push_back(each.descriptor.name);
    refuse_name("parameter", parameter.name, known);
  }
  if (!row->set)
    throw Error("parameter '" + parameter.name + "'", "safety limits cannot be set by a network",
                "start the program with --limit");
  if (parameter.value.type == ParameterValue::not_set)
    throw Error("parameter '" + parameter.name + "'", "it cannot be deleted",
                "set it to its default");
  row->set(settings, parameter.value);
}

}  // namespace palpate
