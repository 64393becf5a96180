// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "palpate/core/uri.hpp"
#include "palpate/sources/source.hpp"

namespace palpate {

/// A camera that somebody publishes: Image or compressedDepth with its CameraInfo, or PointCloud2;
/// its pose by TF.
/// @throws Error if nobody publishes it within its option `wait`, naming what is there.
std::unique_ptr<Source> open_ros2_camera(const Uri& uri);

}  // namespace palpate
