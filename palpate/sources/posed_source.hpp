// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <Eigen/Geometry>

#include "palpate/sources/source.hpp"

namespace palpate {

/// A source whose camera stands elsewhere than the source says: every frame's pose is replaced.
///
/// Depth images get the pose as their world_from_camera; points and their viewpoint, which are in
/// the world already, are moved by it. Copies each frame, on the camera's thread.
/// @param world_from_camera  of the optical frame; of points, world_from_source
/// @param uri  the source's, if it says this pose; empty: the source's own
std::unique_ptr<Source> with_pose(std::unique_ptr<Source> source,
                                  const Eigen::Isometry3d& world_from_camera, std::string uri = {});

}  // namespace palpate
