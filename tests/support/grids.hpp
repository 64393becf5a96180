// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <vector>

#include "palpate/kernel/core/patch.hpp"

namespace palpate::test {

/// A height field sampled on a square grid about the origin.
/// @param spacing  [m] between points
/// @param half     points on each side of the middle one
/// @param height   [m] z(x, y)
template <class Height>
std::vector<Vec3> grid(double spacing, int half, const Height& height) {
  std::vector<Vec3> points;
  for (int j = -half; j <= half; ++j) {
    for (int i = -half; i <= half; ++i) {
      const double x = i * spacing;
      const double y = j * spacing;
      points.emplace_back(x, y, height(x, y));
    }
  }
  return points;
}

/// The flat grid of section 5: spacing 0.3 r_c at z = 0.
inline std::vector<Vec3> flat_grid(double z = 0.0, double spacing = 1.5e-3, int half = 50) {
  return grid(spacing, half, [z](double, double) { return z; });
}

/// Lowest and highest that a ball of radius r_c rests on a flat grid of that spacing: between four
/// points, and over one.
inline double lowest_rest(double r_c, double spacing) {
  return std::sqrt(r_c * r_c - 0.5 * spacing * spacing);
}

}  // namespace palpate::test
