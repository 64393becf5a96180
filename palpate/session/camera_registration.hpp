// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// Where a second camera stands to a first one.
struct CameraFit {
  Eigen::Isometry3d first_from_second = Eigen::Isometry3d::Identity();  ///< optical frames
  /// Of a small turn [rad] about `centre` and a shift [m], axes of the first camera: what the
  /// noise of the depth leaves open. A wrong lens or scale of depth comes on top.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Vec3 centre = Vec3::Zero();  ///< [m, first camera] mean of what both see
  double rms = 0.0;            ///< [m] of the distances between the two surfaces
  double overlap = 0.0;        ///< [-] of the second image that fits what the first sees

  [[nodiscard]] double turn_deviation() const;   ///< [rad] the largest standard deviation
  [[nodiscard]] double shift_deviation() const;  ///< [m] likewise, at `centre`
};

/// Finds where the second camera stands from what both see of a scene at rest: the rigid motion
/// that takes its points onto the planes about those of the first (point-to-plane ICP, Chen and
/// Medioni 1992, with pairs by projection and Tukey's weights).
/// @param start  rough first_from_second, off by at most some 10 cm and 10 degrees
/// @throws Error if they see too little in common, if the surfaces do not fit, or if the geometry
///         leaves a shift or a turn open, such as those along and about a single plane.
CameraFit register_cameras(const DepthImage& first, const DepthImage& second,
                           const Eigen::Isometry3d& start);

}  // namespace palpate
