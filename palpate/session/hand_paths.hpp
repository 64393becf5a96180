// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// A path that strokes what an image shows: it comes down on the surface, presses into it and
/// strokes it in circles, following its relief, and comes up again. It is lifted over edges, behind
/// which a camera sees nothing.
///
/// Circles have a third of the image's height as diameter; one takes four seconds. The path keeps
/// `press` behind the measured surface along the camera's lines of sight.
/// @param duration  [s] of the whole path, at least 2
/// @param press     [m]
/// @throws Error if the middle of the image measures nothing.
HipPath stroke_path(const DepthImage& image, double duration, double press);

/// Where a hand can hover at first [m, world]: 50 mm before the middle of what a camera sees.
Vec3 hover_place(const Cloud& cloud);

}  // namespace palpate
