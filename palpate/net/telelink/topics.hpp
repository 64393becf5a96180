// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/drivers/dds.hpp"
#include "palpate/io/bag/node_messages.hpp"

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

/// What the robot's end says by a dds::Writer for each topic, and the operator's hears by a
/// dds::Reader: of the same types and qualities, or neither finds the other.
template <class Port>
struct FromRobot {
  FromRobot(dds::Participant& participant, const TeleopTopics& topics)
      : tool(participant, topics.tool, ros::PoseStamped{}, newest_alone),
        twist(participant, topics.twist, ros::TwistStamped{}, newest_alone),
        contact(participant, topics.contact, ros::WrenchStamped{}, newest_alone),
        links(participant, topics.links, ros::Float64MultiArray{}, newest_alone),
        joints(participant, topics.joints, ros::JointState{}, newest_alone),
        fault(participant, topics.fault, ros::String{}, kept_for_late),
        regions(participant, topics.regions, ros::String{}, kept_for_late),
        touched(participant, topics.touched, ros::Float64MultiArray{}, each_one) {}

  Port tool, twist, contact, links, joints, fault, regions, touched;
};

}  // namespace palpate
