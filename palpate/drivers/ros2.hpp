// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// `ros2:/TOPIC` as a camera and `ros2:PRESET` as a device: topics of ROS 2 on the network, without
/// ROS (docs/ros.md).
Driver ros2_driver();

}  // namespace palpate
