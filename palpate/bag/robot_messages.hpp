// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/bag/node_messages.hpp"

// What robots of ROS 2 say besides their poses and wrenches.
namespace palpate::ros {

struct TwistStamped {
  static constexpr std::string_view type = "geometry_msgs/msg/TwistStamped";
  Header header;
  std::array<double, 3> linear{}, angular{};  ///< [m/s], [rad/s]

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    walk_header(way, m.header);
    way.array(m.linear);
    way.array(m.angular);
  }
};

struct JointState {
  static constexpr std::string_view type = "sensor_msgs/msg/JointState";
  Header header;
  std::vector<std::string> name;
  std::vector<double> position, velocity, effort;  ///< as long as `name`, or empty

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    walk_header(way, m.header);
    way.texts(m.name);
    way.numbers(m.position);
    way.numbers(m.velocity);
    way.numbers(m.effort);
  }
};

/// A text that is told once and kept for those that come later.
struct Text {
  static constexpr std::string_view type = "std_msgs/msg/String";
  std::string data;

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.text(m.data);
  }
};

}  // namespace palpate::ros
