// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/drivers/dds.hpp"
#include "palpate/io/bag/node_messages.hpp"

namespace palpate {

/// A topic of a link.
inline std::string teleop_topic(const std::string& robot, const char* of) {
  return "/" + robot + "/teleop/" + of;
}

/// Of what is told again and again, of what is told when it happens, and of what holds on.
inline constexpr dds::Quality newest_alone{};
inline constexpr dds::Quality each_one{.reliable = true};
inline constexpr dds::Quality kept_for_late{.reliable = true, .keeps_for_late = true};

/// The orientation of a pose; it may be none: see is_rotation.
inline Rotation orientation_of(const ros::PoseStamped& pose) {
  const auto& [x, y, z, w] = pose.orientation;
  return {w, x, y, z};
}

/// What the robot's end says by a dds::Writer for each topic, and the operator's hears by a
/// dds::Reader: of the same types and qualities, or neither finds the other.
template <class Port>
struct FromRobot {
  FromRobot(dds::Participant& participant, const std::string& robot)
      : tool(participant, teleop_topic(robot, "tool"), ros::PoseStamped{}, newest_alone),
        found(participant, teleop_topic(robot, "found"), ros::PoseStamped{}, kept_for_late),
        twist(participant, teleop_topic(robot, "twist"), ros::TwistStamped{}, newest_alone),
        contact(participant, teleop_topic(robot, "contact"), ros::WrenchStamped{}, newest_alone),
        links(participant, teleop_topic(robot, "links"), ros::Float64MultiArray{}, newest_alone),
        joints(participant, "/" + robot + "/joint_states", ros::JointState{}, newest_alone),
        fault(participant, teleop_topic(robot, "fault"), ros::String{}, kept_for_late),
        regions(participant, teleop_topic(robot, "regions"), ros::String{}, kept_for_late),
        touched(participant, teleop_topic(robot, "touched"), ros::Float64MultiArray{}, each_one) {}

  Port tool, found, twist, contact, links, joints, fault, regions, touched;
};

}  // namespace palpate
