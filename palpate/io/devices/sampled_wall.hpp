// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/io/devices/device_body.hpp"

namespace palpate {

/// A handle on a sampled wall: what moves, and what drives it.
struct SampledWall {
  MassSpringDamper handle;  ///< device and hand; the hand's spring holds it
  double damping = 0.0;     ///< [N s/m] k_d of the wall, on the filtered velocity
  double period = 1e-3;     ///< [s] T: the force is held for that long
  double delay = 1e-3;      ///< [s] t_d, from a write to the force
  double filter = 2e-3;     ///< [s] time constant of the velocity, as HandVelocity's; 0: none
};

/// [N/m] 2 (b + k_d) / (T + 2 t_d): what a slow swing decays with. The hold and the delay of a
/// spring K act on it like a damping of -K (T/2 + t_d).
constexpr double delayed_stiffness(const SampledWall& wall) {
  return 2.0 * (wall.handle.damping + wall.damping) / (wall.period + 2.0 * wall.delay);
}

/// The stiffest spring [N/m] with which the linear loop decays, exactly: no Coulomb friction, no
/// resolution, no limit of the force, the wall never left. To 0.1 %, up to `most`; 0 where the
/// softest does not.
double linear_stiffness(const SampledWall& wall, double most);

}  // namespace palpate
