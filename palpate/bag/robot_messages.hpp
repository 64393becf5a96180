// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/bag/messages.hpp"

// What robots of ROS 2 say besides their poses and wrenches.
namespace palpate::ros {

struct TwistStamped {
  static constexpr std::string_view type = "geometry_msgs/msg/TwistStamped";
  Header header;
  std::array<double, 3> linear{}, angular{};  ///< [m/s], [rad/s]

  static void walk(auto& way, auto& m) { way(m.header, m.linear, m.angular); }
};

struct JointState {
  static constexpr std::string_view type = "sensor_msgs/msg/JointState";
  Header header;
  std::vector<std::string> name;
  std::vector<double> position, velocity, effort;  ///< as long as `name`, or empty

  static void walk(auto& way, auto& m) { way(m.header, m.name, m.position, m.velocity, m.effort); }
};

}  // namespace palpate::ros
