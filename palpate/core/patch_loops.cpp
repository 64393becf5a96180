// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/patch_loops.hpp"

#include <cmath>
#include <limits>

#include "palpate/core/patch.hpp"
#include "palpate/core/vectorise.hpp"

// Plain loops that the compiler turns into vector code. This file is compiled with leave to add in
// any order and to take every number for finite (CMakeLists.txt): that is what makes a sum or a
// minimum a vector operation, down to its last few lanes.

namespace palpate {
namespace {

// A patch ends with a whole block; said so that no loop needs a remainder.
constexpr std::size_t whole_blocks(std::size_t size) {
  return size / Patch::block * Patch::block;
}

PALPATE_VECTORISED
DirectionSums sum(const PointArrays& points, const Float3& at, float r_3, float inverse_width) {
  const auto [x, y, z, size] = points;
  const auto [px, py, pz] = at;
  const float reach = r_3 * inverse_width;
  float sum_x = 0.0F;
  float sum_y = 0.0F;
  float sum_z = 0.0F;
  float nearest = std::numeric_limits<float>::max();
  const std::size_t end = whole_blocks(size);
  for (std::size_t i = 0; i < end; ++i) {
    const float dx = px - x[i];
    const float dy = py - y[i];
    const float dz = pz - z[i];
    constexpr float smallest = 1e-18F;  // a nanometre, squared: keeps 1 / r finite
    const float squared = dx * dx + (dy * dy + (dz * dz + smallest));
    const float r = std::sqrt(squared);
    // Eq. (2) with s = (r_3 - r) / (r_3 - r_1) kept in 0..1, hence 1 within r_1 and 0 beyond r_3.
    float s = reach - r * inverse_width;
    s = s < 0.0F ? 0.0F : s;
    s = s > 1.0F ? 1.0F : s;
    const float s_2 = s * s;
    const float psi = s_2 * s_2 * (5.0F - 4.0F * s);
    const float scale = psi / r;
    sum_x += dx * scale;  // Eq. (1)
    sum_y += dy * scale;
    sum_z += dz * scale;
    nearest = squared < nearest ? squared : nearest;
  }
  return {{sum_x, sum_y, sum_z}, nearest};
}

PALPATE_VECTORISED
float travel(const PointArrays& points, const Float3& at, const Float3& direction,
             float squared_r_c, float unlimited) {
  const auto [x, y, z, size] = points;
  const auto [px, py, pz] = at;
  const auto [dir_x, dir_y, dir_z] = direction;
  float smallest = unlimited;
  const std::size_t end = whole_blocks(size);
  for (std::size_t i = 0; i < end; ++i) {
    const float wx = x[i] - px;
    const float wy = y[i] - py;
    const float wz = z[i] - pz;
    const float along = wx * dir_x + wy * dir_y + wz * dir_z;
    // Eq. (9): |w - d dir| = r_c has the roots along -+ sqrt(under); their product is `outside`, so
    // the smaller one is outside / (along + sqrt(under)), which does not cancel.
    const float outside = wx * wx + wy * wy + wz * wz - squared_r_c;
    const float under = along * along - outside;
    const float root = std::sqrt(under > 0.0F ? under : 0.0F);
    const float positive = along > 1e-9F ? along : 1e-9F;
    float d = outside / (positive + root);
    d = d > 0.0F ? d : 0.0F;
    const bool ahead = along > 0.0F;
    const bool meets = under >= 0.0F;
    d = (ahead & meets) ? d : unlimited;
    smallest = d < smallest ? d : smallest;
  }
  return smallest;
}

PALPATE_VECTORISED
float escape(const PointArrays& points, const Float3& at, const Float3& direction,
             float squared_r_1, float squared_r_c) {
  const auto [x, y, z, size] = points;
  const auto [px, py, pz] = at;
  const auto [dir_x, dir_y, dir_z] = direction;
  float largest = 0.0F;
  const std::size_t end = whole_blocks(size);
  for (std::size_t i = 0; i < end; ++i) {
    const float wx = x[i] - px;
    const float wy = y[i] - py;
    const float wz = z[i] - pz;
    const float along = wx * dir_x + wy * dir_y + wz * dir_z;
    const float squared = wx * wx + wy * wy + wz * wz;
    const float under = along * along + squared_r_c - squared;
    // Eq. (10): the positive root; `under` is positive wherever the point is entrenched.
    const float d = along + std::sqrt(under > 0.0F ? under : 0.0F);
    const float entrenched = squared < squared_r_1 ? d : 0.0F;
    largest = entrenched > largest ? entrenched : largest;
  }
  return largest;
}

}  // namespace

// The choice between the clones has to be local to a file: compilers disagree on its symbols.

DirectionSums sum_directions(const PointArrays& points, Float3 at, float r_3,
                             float inverse_width) noexcept {
  return sum(points, at, r_3, inverse_width);
}

float smallest_travel(const PointArrays& points, Float3 at, Float3 direction, float squared_r_c,
                      float unlimited) noexcept {
  return travel(points, at, direction, squared_r_c, unlimited);
}

float largest_escape(const PointArrays& points, Float3 at, Float3 direction, float squared_r_1,
                     float squared_r_c) noexcept {
  return escape(points, at, direction, squared_r_1, squared_r_c);
}

}  // namespace palpate
