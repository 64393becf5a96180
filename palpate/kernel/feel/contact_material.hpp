// SPDX-License-Identifier: Apache-2.0
// What the material at one contact does to its force: of a ball's, and of each of a tool's.
#pragma once

#include "palpate/kernel/core/material.hpp"
#include "palpate/kernel/core/observed_clouds.hpp"

namespace palpate {

/// Is there anything to add to a force?
/// @param stiffness  [N/m] of the coupling
bool has_feel(const Material& material, double stiffness) noexcept;

/// The material at a place on the surface.
struct ContactMaterial {
  /// [m] over which materials are averaged along the surface: no border causes a step.
  static constexpr double averaged = 3e-3;

  Material material;
  Vec3 slope = Vec3::Zero();  ///< [1/m] of the brightness there

  /// Looks it up, unless the place is within 0.1 mm of the last one. [servo]
  /// @param scene      the material where no other is
  /// @param stiffness  [N/m] of the coupling
  /// @param foot       [m] world: the place; @param normal  [-] of the surface there; zero: unknown
  void look(const ObservedClouds& clouds, const Material& scene, double stiffness, const Vec3& foot,
            const Vec3& normal) noexcept;
  void forget() noexcept { looked_ = false; }  ///< The next look is a new one.

  /// [-] of the normal force that a cushion leaves, 0 to 2.
  /// @param away  [m/s] at which the hand moves out
  [[nodiscard]] double cushion(double away) const noexcept;
  /// [-] by which a relief pushes along the surface, as a share of the normal force.
  [[nodiscard]] Vec3 downhill(const Vec3& normal) const noexcept;
  /// [-] The vibration of grains as a share of the normal force.
  /// @param noise  of variance 1, as `Grain` gives it
  [[nodiscard]] double vibration(double noise) const noexcept;

 private:
  Vec3 looked_at_ = Vec3::Zero();  // [m]
  bool looked_ = false;
};

/// The largest share of `more`, up to 1, with which a force [N] stays within a limit.
double share_within(double limit, const Vec3& force, const Vec3& more) noexcept;

}  // namespace palpate
