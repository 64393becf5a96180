// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "palpate/cloud/depth_image.hpp"

namespace palpate {

/// How far `point` lies behind what the camera measured around it, along the optical axis [m];
/// negative in front. None where fewer than half of the pixels measured anything.
///
/// The median over the footprint of a ball, so that it holds under noise and at edges; independent
/// of how a proxy got to where it is. A proxy that was in front of a surface and is behind it now
/// has probably popped through, or went around an edge.
/// @param point   [m] world
/// @param radius  [m] of the footprint, usually r_c
std::optional<double> distance_behind(const DepthImage& image, const Vec3& point,
                                      double radius) noexcept;

}  // namespace palpate
