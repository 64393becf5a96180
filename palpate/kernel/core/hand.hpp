// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// A rotation as a quaternion of length 1, without Eigen's alignment, so that it can be a member of
/// anything.
using Rotation = Eigen::Quaternion<double, Eigen::DontAlign>;

/// Where a hand is in the scene.
struct HandPose {
  Vec3 position = Vec3::Zero();                 ///< [m] world: the HIP
  Rotation orientation = Rotation::Identity();  ///< world_from_handle
};

/// What acts on a hand.
struct Wrench {
  Vec3 force = Vec3::Zero();   ///< [N]
  Vec3 torque = Vec3::Zero();  ///< [N m] about the HIP
};

/// [N] Up to here the direction of a force is that of rounding errors.
inline constexpr double undirected_force = 1e-6;

}  // namespace palpate
