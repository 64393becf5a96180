// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// Distance [m] along the optical axis from the measured surface to `point`: positive behind the
/// surface, negative in front. Empty if fewer than half of the pixels have a measurement.
///
/// The median over the footprint of a sphere, so that it is valid with noise and at edges;
/// independent of the path of a proxy. A proxy that was in front of a surface and is behind it now
/// has probably popped through, or went around an edge.
/// @param point   [m] world
/// @param radius  [m] of the footprint, usually r_c
std::optional<double> distance_behind(const DepthImage& image, const Vec3& point,
                                      double radius) noexcept;

}  // namespace palpate
