// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "palpate/io/bag/node_messages.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate {

/// A session's settings as a node's parameters: the method's own by their names, `method`,
/// `placement.NAME`, and `safety.NAME`, which can be read alone: whoever is on the network cannot
/// loosen a limit.
class NodeParameters {
 public:
  explicit NodeParameters(const MethodRegistry& methods);

  /// All of them, by name.
  [[nodiscard]] std::vector<ros::Parameter> all(const ServoSettings& settings) const;
  /// `not_set` where there is none of that name.
  [[nodiscard]] ros::ParameterValue get(const ServoSettings& settings,
                                        const std::string& name) const;
  /// With meaning, unit, default and range. Without a type where there is none of that name.
  [[nodiscard]] ros::ParameterDescriptor describe(const std::string& name) const;
  /// As rcl_interfaces has it: those whose name is a prefix or lies below one, to that depth.
  [[nodiscard]] ros::ParametersFound list(const ros::ParametersWithin& within) const;
  /// Whole numbers are treated as numbers, as people write them.
  /// @throws Error for an unknown name (naming the nearest), a value of another type or out of its
  ///         range, and what can be read alone.
  void set(ServoSettings& settings, const ros::Parameter& parameter) const;

 private:
  struct Row {
    ros::ParameterDescriptor descriptor;
    std::function<ros::ParameterValue(const ServoSettings&)> get;
    std::function<void(ServoSettings&, const ros::ParameterValue&)> set;  ///< empty: read alone
  };
  template <class Table, class Part>
  void add_table(const std::string& prefix, const Table& table, Part ServoSettings::*part,
                 bool read_only);
  [[nodiscard]] const Row* find(const std::string& name) const;

  std::vector<Row> rows_;  // by name
};

}  // namespace palpate
