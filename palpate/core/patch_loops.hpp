// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace palpate {

// The inner loops of the method. All lengths in metres relative to the patch's origin, everything
// finite.

struct Float3 {
  float x, y, z;
};

/// Points (x[i], y[i], z[i]); `size` is a multiple of Patch::block.
struct PointArrays {
  const float* x;
  const float* y;
  const float* z;
  std::size_t size;
};

struct DirectionSums {
  Float3 direction;       ///< n' of (1)
  float nearest_squared;  ///< [m^2] to the nearest point
};

/// Eq. (1) with the weights of (2); `inverse_width` is 1 / (r_3 - r_1).
DirectionSums sum_directions(const PointArrays& points, Float3 at, float r_3,
                             float inverse_width) noexcept;

/// Eq. (9) over the points ahead; `unlimited` if none is met.
float smallest_travel(const PointArrays& points, Float3 at, Float3 direction, float squared_r_c,
                      float unlimited) noexcept;

/// Eq. (10) over the points within r_1; 0 if there are none.
float largest_escape(const PointArrays& points, Float3 at, Float3 direction, float squared_r_1,
                     float squared_r_c) noexcept;

}  // namespace palpate
