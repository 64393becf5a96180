// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "palpate/kernel/core/parameters.hpp"
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

}  // namespace palpate::lab
