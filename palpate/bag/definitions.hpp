// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace palpate::ros {

/// The definition of a message that a recording is made of and of all that it consists of, as
/// schemas of MCAP have it ("ros2msg"): with it a reader needs no package of ROS's.
/// @param type  such as sensor_msgs/msg/CameraInfo  @return empty for a type that is not known
std::string definition_of(std::string_view type);

}  // namespace palpate::ros
