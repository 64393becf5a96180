// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"

namespace palpate {

/// What was measured at one pixel, and around it.
struct PixelProbe {
  /// Half the side of the square of neighbours that are counted [px].
  static constexpr int neighbourhood = 3;

  std::optional<Vec3> in_world{};  ///< [m] the point; none for a hole
  std::optional<Vec3>
      in_camera{};                ///< [m, optical frame]; none for a hole or points without a pose
  std::optional<double> depth{};  ///< [m] along the optical axis; as in_camera
  /// [-, world] of the plane through the points around it, towards the camera. None for a hole, or
  /// where the points around it do not lie near a plane, as at an edge or in strong noise.
  std::optional<Vec3> normal{};
  int normal_radius = 0;  ///< [px] half the side of the square of points that the normal is from
  int neighbours = 0;     ///< pixels around it, within `neighbourhood` and within the image
  int measured = 0;       ///< how many of those are no holes
};

/// Pixel (u, v) of a depth image. @throws Error if it is outside the image.
PixelProbe probe_pixel(const DepthImage& image, int u, int v);

/// Pixel (u, v) of an organised cloud: column and row of a point. Without a viewpoint the camera is
/// taken to be at the origin, as in the files of most cameras.
/// @throws Error if the cloud is not organised, or the pixel is outside.
PixelProbe probe_pixel(const PointCloud& cloud, int u, int v);

}  // namespace palpate
