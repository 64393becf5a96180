// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/drivers/dds.hpp"

namespace palpate {

/// The topics of a link, by the robot's name.
struct TeleopTopics {
  explicit TeleopTopics(const std::string& name)
      : place("/" + name + "/teleop/place"),
        press("/" + name + "/teleop/press"),
        tool("/" + name + "/teleop/tool"),
        twist("/" + name + "/teleop/twist"),
        contact("/" + name + "/teleop/contact"),
        links("/" + name + "/teleop/links"),
        fault("/" + name + "/teleop/fault"),
        regions("/" + name + "/teleop/regions"),
        touched("/" + name + "/teleop/touched"),
        joints("/" + name + "/joint_states") {}

  std::string place, press;                                                  // from the operator
  std::string tool, twist, contact, links, fault, regions, touched, joints;  // from the robot
};

/// Of what is told again and again, of what is told when it happens, and of what holds on.
inline constexpr dds::Quality newest_alone{};
inline constexpr dds::Quality each_one{.reliable = true};
inline constexpr dds::Quality kept_for_late{.reliable = true, .keeps_for_late = true};

}  // namespace palpate
