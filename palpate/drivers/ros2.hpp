// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/servo/device.hpp"

namespace palpate {

/// A camera that somebody publishes: Image or compressedDepth with its CameraInfo, or PointCloud2;
/// its pose by TF.
/// @throws Error if nobody publishes it within its option `wait`, naming what is there.
std::unique_ptr<Source> open_ros2_camera(const Uri& uri);

/// How a haptic node of ROS 2 tells its pose and takes forces.
struct Ros2Hand {
  std::string name = {};                   ///< of the preset
  std::string node = "a node of its own";  ///< whose it is, in a line
  std::string pose = {};                   ///< topic; NAME stands for the device's name
  std::string pose_type = "PoseStamped";   ///< or Point
  std::string force = {};                  ///< topic
  /// WrenchStamped, Wrench, Vector3, Float64MultiArray, OmniFeedback
  std::string force_type = "WrenchStamped";
  std::string button = {};     ///< topic of Bool, or empty
  std::string axes = "x,y,z";  ///< of the topics that are right, away and up: "y,-x,z"
};

/// The nodes that are known by name.
const std::vector<Ros2Hand>& ros2_hands();

/// A haptic node of ROS 2: its pose is the hand's, and forces are published to it.
///
/// Nodes hold the force that came last for ever. So zero is published whenever there is no force,
/// and several times at the end; and whoever opens it puts it into a guard (open_guarded).
/// @throws Error if there is nobody who tells a pose or takes forces within its option `wait`.
std::unique_ptr<Device> open_ros2_device(const Uri& uri);

}  // namespace palpate
