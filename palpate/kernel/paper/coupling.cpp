// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/paper/coupling.hpp"

namespace palpate {

CouplingForce coupling_force(const Coupling& coupling, const Vec3& u, double distance_rate,
                             double r_c, bool as_printed) noexcept {
  const double distance = u.norm();
  if (!(distance > r_c)) return {Vec3::Zero(), false};  // 4.6: only when the HIP is outside r_c
  const double damper = coupling.damping * distance_rate;
  const double spring = coupling.stiffness * (distance - r_c);
  const double magnitude = as_printed ? spring - damper : spring + damper;  // Eq. (16)
  if (!(magnitude > 0.0)) return {Vec3::Zero(), false};
  const bool saturated = magnitude > coupling.max_force;
  return {-u / distance * (saturated ? coupling.max_force : magnitude), saturated};
}

}  // namespace palpate
