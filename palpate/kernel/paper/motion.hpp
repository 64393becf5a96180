// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// Eq. (3): how the proxy is moved when the cloud is updated [m].
/// @param velocity  [m/s] v of the surface along `normal`
/// @param interval  [s] between the stamps of the two frames (the print: 1/f_c)
inline Vec3 frame_correction(double velocity, const Vec3& normal, double interval) noexcept {
  return interval * velocity * normal;  // Eq. (3)
}

/// Eq. (13): the surface velocity after an update [m/s], clipped at 0.
/// @param velocity  [m/s] the estimate with which the proxy was corrected
/// @param normal    [-] n before the update
/// @param step      [m] the first proxy step after the update
/// @param interval  [s] between the stamps of the two frames (the print: 1/f_c)
inline double updated_velocity(double velocity, const Vec3& normal, const Vec3& step,
                               double interval) noexcept {
  const double updated = velocity + normal.dot(step) / interval;  // Eq. (13)
  return updated > 0.0 ? updated : 0.0;
}

}  // namespace palpate
