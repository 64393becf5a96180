// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// The camera that saw an organised cloud.
struct GridCamera {
  std::shared_ptr<const ViewingRays> rays;
  Eigen::Isometry3d world_from_camera;  ///< its optical frame in the frame of the points
};

/// Fits a pinhole camera to points in the order of an image: first with the points in its optical
/// frame, then wherever it stood and however it was turned. O(points).
/// @param points     width * height, row by row; a hole has a coordinate that is not finite
/// @param viewpoint  where it is said to have stood; without, the origin is tried
/// @return none unless 99.9 % of the points lie within half a pixel of where the camera sees them,
///         in front of it, and there are 100 or more in an image of 16x16 or more
[[nodiscard]] std::optional<GridCamera> fit_camera(std::span<const Vec3> points, int width,
                                                   int height,
                                                   const std::optional<Vec3>& viewpoint);

/// The organised points as the depth image of that camera; those that it does not see within half a
/// pixel of their place are holes. Its unit is the finest of 1, 2 or 5 times a power of ten that
/// holds the farthest point, from 1 um on.
/// @return null if the fit is not as fit_camera wants it, or a unit would be coarser than 1 mm and
///         than a thousandth of the median depth
[[nodiscard]] std::shared_ptr<const DepthImage> depth_image_of(std::span<const Vec3> points,
                                                               const GridCamera& camera);

/// The organised clouds of one camera, one after the other: it is fitted to the first of them, and
/// again to one that does not fit.
class OrganisedClouds {
 public:
  /// The points as the depth image of their camera, or null if a pinhole camera did not see them
  /// so.
  /// @param points     as in fit_camera, in a frame in which the camera stands still
  /// @param viewpoint  in that frame, as in fit_camera
  /// @param pose       of that frame in the world
  std::shared_ptr<const DepthImage> image(
      std::span<const Vec3> points, std::size_t width, std::size_t height,
      const std::optional<Vec3>& viewpoint = std::nullopt,
      const Eigen::Isometry3d& pose = Eigen::Isometry3d::Identity());

 private:
  std::optional<GridCamera> camera_;
};

}  // namespace palpate
