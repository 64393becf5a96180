// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/patch_loops.hpp"

#include <cmath>

#include "palpate/kernel/core/vectorise.hpp"

// Plain loops that the compiler turns into vector code. This file is compiled with leave to take
// every number for finite (CMakeLists.txt): that is what makes a minimum a vector operation.

namespace palpate {
namespace {

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

float smallest_travel(const PointArrays& points, Float3 at, Float3 direction, float squared_r_c,
                      float unlimited) noexcept {
  return vectorised<travel>(points, at, direction, squared_r_c, unlimited);
}

float largest_escape(const PointArrays& points, Float3 at, Float3 direction, float squared_r_1,
                     float squared_r_c) noexcept {
  return vectorised<escape>(points, at, direction, squared_r_1, squared_r_c);
}

}  // namespace palpate
