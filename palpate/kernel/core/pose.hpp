// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include <Eigen/Geometry>

namespace palpate {

/// Is `pose` finite, a rotation without reflection and a translation?
/// @param tolerance  largest element of |R R^T - I|, -
[[nodiscard]] bool is_rigid(const Eigen::Isometry3d& pose, double tolerance = 1e-6) noexcept;

/// @param subject  what the pose is, for the message, such as "world_from_device"
/// @throws Error if `pose` is not rigid to within 1e-6.
void check_rigid(const Eigen::Isometry3d& pose, const std::string& subject);

/// Reads "x,y,z,qx,qy,qz,qw": a translation [m] and a quaternion, by commas or spaces.
/// @param subject  the option or key concerned, for messages
/// @throws Error unless there are seven finite numbers, the translation is within 1000 km and the
///         quaternion's length within 1 % of 1. The quaternion is normalised.
Eigen::Isometry3d parse_pose(std::string_view text, const std::string& subject);

/// The seven numbers of `pose` as parse_pose reads them, in digits that give back the same doubles
/// up to the quaternion's rounding; qw is not negative.
std::string pose_text(const Eigen::Isometry3d& pose);

/// `value` in the fewest digits that give back the same double.
std::string shortest(double value);

}  // namespace palpate
