// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "palpate/cloud/depth_image.hpp"
#include "palpate/devices/hip_path.hpp"

namespace palpate {

/// A pixel of a depth image: column u and row v, from 0 at the top left.
struct Pixel {
  int u = 0;
  int v = 0;
};

/// Reads "U,V". @param subject  the option concerned, for messages
/// @throws Error unless there are two whole numbers.
Pixel parse_pixel(std::string_view text, const std::string& subject);

/// Depth along the optical axis at a pixel [m]: the median of the measured pixels of the 7x7 about
/// it; none if there are none. O(1), allocates nothing.
std::optional<double> median_depth(const DepthImage& image, Pixel pixel) noexcept;

/// The surface at a pixel [m, world], by median_depth.
/// @throws Error for a pixel outside the image, or where nothing was measured (naming the nearest
///         pixel where something was).
Vec3 surface_at(const DepthImage& image, Pixel pixel);

/// How a surface is pressed and stroked.
struct PressOptions {
  double depth = 8e-3;     ///< [m] of the HIP behind the surface, along the line of sight
  double speed = 0.05;     ///< [m/s] of the HIP, down, along and up
  double approach = 0.06;  ///< [m] in front of the surface, where the path begins and ends
  double hold = 0.5;       ///< [s] to stay after pressing and before lifting
  std::optional<Pixel> slide_to = {};  ///< stroke the surface to there, in between
};

/// A path that presses a surface where a pixel sees it: along the line of sight down to
/// `depth` behind it, hold, slide if asked to, hold, and up again.
///
/// A slide follows the measured surface along the straight line between the two pixels; over holes
/// the depth goes on as it was.
/// @param start  [s] time of the first sample
/// @throws Error as surface_at, or for depth, speed, approach or hold out of range.
HipPath press_path(const DepthImage& image, Pixel at, const PressOptions& options = {},
                   double start = 0.0);

}  // namespace palpate
