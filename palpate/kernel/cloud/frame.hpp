// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/cloud.hpp"

namespace palpate {

/// An image in visible light that belongs to a frame: 8 bits each of red, green and blue.
///
/// Without a `camera` it is registered to the frame's cloud: pixel i shows what pixel i of a
/// DepthImage measured, or point i of PointCloud::surface(), and the sizes are the same (a cloud
/// that is no image has one row). A hole in the depth may have a colour.
struct ColourImage {
  /// A colour camera beside the depth camera.
  struct Camera {
    Intrinsics intrinsics;
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();  ///< optical frame
  };

  int width = 0;                   ///< [px]
  int height = 0;                  ///< [px]
  std::vector<std::uint8_t> rgb;   ///< row by row, 3 * width * height: red, green, blue
  std::optional<Camera> camera{};  ///< none: registered to the cloud
};

/// One capture of a camera.
struct Frame {
  /// [s] when it was captured, by the clock that SourceInfo::clock names.
  double stamp = 0.0;
  /// What was measured; a DepthImage where there is a depth image.
  std::shared_ptr<const Cloud> cloud{};
  /// Null where the source has no colour, or was not asked for it.
  std::shared_ptr<const ColourImage> colour{};
  /// What each pixel of a DepthImage is made of, row by row: labels of a MaterialTable, 0 for none
  /// of them. Null where the source has none.
  std::shared_ptr<const std::vector<std::uint8_t>> labels{};
  /// [s, CLOCK_MONOTONIC] when it reached this machine, where the source knows better than whoever
  /// called it: a driver's own time of arrival.
  std::optional<double> arrival{};
};

}  // namespace palpate
