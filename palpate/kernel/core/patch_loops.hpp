// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace palpate {

// The loops that search a patch. All lengths in metres relative to the patch's origin, everything
// finite.

/// Loops over a patch read whole blocks of points: the widest vector of floats there is.
inline constexpr std::size_t patch_block = 16;

struct Float3 {
  float x, y, z;
};

/// Points (x[i], y[i], z[i]); `size` is a multiple of `patch_block`.
struct PointArrays {
  const float* x;
  const float* y;
  const float* z;
  std::size_t size;
};

/// A patch ends with a whole block; said so that no loop needs a remainder.
constexpr std::size_t whole_blocks(std::size_t size) noexcept {
  return size / patch_block * patch_block;
}

/// Eq. (9) over the points ahead; `unlimited` if none is met.
float smallest_travel(const PointArrays& points, Float3 at, Float3 direction, float squared_r_c,
                      float unlimited) noexcept;

/// Eq. (10) over the points within r_1; 0 if there are none.
float largest_escape(const PointArrays& points, Float3 at, Float3 direction, float squared_r_1,
                     float squared_r_c) noexcept;

}  // namespace palpate
