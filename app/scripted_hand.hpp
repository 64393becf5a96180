// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/cloud/depth_image.hpp"
#include "palpate/devices/hip_path.hpp"

namespace palpate::app {

/// A hand that needs no person: it comes down on what `image` shows, presses into it and strokes it
/// in circles, following its relief, and comes up again. It is lifted over edges, behind which a
/// camera sees nothing.
///
/// Circles have a third of the image's height as diameter; one takes four seconds. The hand keeps
/// `press` behind the measured surface along the camera's sightlines.
/// @param duration  [s] of the whole path, at least 2
/// @param press     [m]
/// @throws Error if the middle of the image measures nothing.
HipPath scripted_hand(const DepthImage& image, double duration, double press);

}  // namespace palpate::app
