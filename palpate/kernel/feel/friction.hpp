// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// [-] Stribeck: from the static coefficient to the kinetic one as a contact slides faster.
/// @param speed  [m/s] of what slides
double friction_coefficient(const FrictionParameters& parameters, double speed) noexcept;

/// Dry friction between hand and surface: the elasto-plastic model of Dupont, Hayward, Armstrong
/// and Altpeter (2002), LuGre's bristle with a range in which it only bends.
///
/// The bristle is what ties the hand to the place on the surface where it stuck: a spring in the
/// tangential plane from its anchor to the hand. It yields where it pulls with the coefficient of
/// friction times the normal force; below 97 % of that the anchor does not move at all, so that a
/// hand that is held does not creep, however long the contact is.
///
/// Unlike there, the anchor yields to the largest normal force of the last tenth of a second. A
/// camera's noise is in the normal force, and each dip of it would let a held hand creep. The force
/// itself shrinks with the normal force of the tick, so that it never exceeds the friction cone.
///
/// [servo] Nothing here allocates, locks or throws.
class Friction {
 public:
  void set(const FrictionParameters& parameters) noexcept { parameters_ = parameters; }
  /// Forgets the contact: the next one begins with no tangential force.
  void reset() noexcept;

  /// Moves the hand on and returns the tangential force on it [N, world]: at right angles to `push`
  /// and at most (static coefficient + viscosity times tangential speed) |push| long.
  ///
  /// @param push      [N] world: the normal force on the hand
  /// @param moved     [m] world: of the hand relative to the surface since the last call
  /// @param velocity  [m/s] world: the same, smoothed, for what depends on the speed
  /// @param dt        [s] since the last call
  Vec3 update(const Vec3& push, const Vec3& moved, const Vec3& velocity, double dt) noexcept;

 private:
  FrictionParameters parameters_;
  Vec3 bristle_ = Vec3::Zero();  // [m] world: from the anchor to the hand
  Vec3 normal_ = Vec3::Zero();   // [-] of the last push
  double pressed_ = 0.0;         // [N] largest normal force of late
  double sliding_ = 0.0;         // [-] share of the last movement by which the anchor moved
};

}  // namespace palpate
