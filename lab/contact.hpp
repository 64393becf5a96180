// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <optional>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch.hpp"
#include "palpate/kernel/core/tick.hpp"

namespace palpate::lab {

/// Where a method holds the hand back.
struct Contact {
  Vec3 point;   ///< [m] world, on the surface as the method has it
  Vec3 normal;  ///< [-] outward
};

/// The tick of a method that holds a point of the hand on a surface: a spring pulls the HIP to
/// that point, and the proxy that the experiments ask for is a sphere of radius r_c upon it.
inline Tick contact_tick(const Parameters& parameters, const Vec3& hip, const Contact& contact,
                         double t, std::int64_t frame) {
  Tick tick = free_tick(hip, t, frame);
  tick.state = ContactState::contact;
  tick.normal = contact.normal;
  tick.proxy = contact.point + parameters.proxy.r_c() * contact.normal;
  tick.force = parameters.coupling.stiffness * (contact.point - hip);
  const double most = parameters.coupling.max_force;
  if (tick.force.norm() > most) tick.force *= most / tick.force.norm();
  return tick;
}

/// The moving-least-squares plane at the middle of a patch [7]: a = sum w x / sum w, and as normal
/// the eigenvector of the weighted covariance with the smallest eigenvalue, towards where the
/// points were seen from (else up). None for less than six points.
/// @param radius  [m] w is Wendland's function down to 0 there
std::optional<Contact> fit_plane(const Patch& patch, double radius);

/// The stiffest spring [N/m] with which a sampled wall stays passive [2]: a device with damping b
/// [N s/m] against a spring K and a damper B held for a period T [s] needs b > K T / 2 + B.
constexpr double passive_stiffness(double device_damping, double damping, double period) {
  return std::max(0.0, 2.0 * (device_damping - damping) / period);
}

}  // namespace palpate::lab
