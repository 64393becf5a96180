// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// Fraction of the coupling stiffness that is rendered while the contact moves between materials.
///
/// Raising the stiffness K by dK at penetration u needs the energy dK u^2 / 2. It is taken from an
/// energy tank, which is filled by decreases of the stiffness, by friction, and by a braking force
/// while the HIP slides towards a stiffer material. While the tank is empty, the stiffness does not
/// rise, so a surface that becomes stiffer under a hand at rest does so only after the hand leaves.
/// Crossing a border never generates energy.
///
/// [servo] Nothing here allocates, locks or throws.
class Hardness {
 public:
  /// Forgets the contact: the next one begins with the material that it meets.
  void reset() noexcept { *this = {}; }

  struct Felt {
    double share = 1.0;         ///< [-] of the coupling's force that is felt
    Vec3 brake = Vec3::Zero();  ///< [N] world: against the sliding
  };

  /// @param wanted    [-] share of the coupling's stiffness that the material has, 0 to 1
  /// @param push      [N] world: the coupling's force
  /// @param stiffness [N/m] of the coupling
  /// @param taken     [J] that friction has taken from the hand since the last call
  /// @param moved     [m] world: of the hand relative to the surface since the last call
  /// @param velocity  [m/s] world: the same, smoothed
  Felt update(double wanted, const Vec3& push, double stiffness, double taken, const Vec3& moved,
              const Vec3& velocity) noexcept;

  [[nodiscard]] double share() const noexcept { return share_; }
  [[nodiscard]] double level() const noexcept { return level_; }  ///< [J] in the tank

 private:
  bool touching_ = false;
  double share_ = 1.0;         // [-] felt now
  double level_ = 0.0;         // [J]
  Vec3 brake_ = Vec3::Zero();  // [N] of the last call
};

}  // namespace palpate
