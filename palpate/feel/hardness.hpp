// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/patch.hpp"

namespace palpate {

/// How much of the coupling's spring a hand feels, as it moves from one material to another.
///
/// A spring K pressed in by u holds K u^2 / 2. Where it gets harder under a hand, by dK, somebody
/// has to pay for dK u^2 / 2: a tank, which is filled by what the spring gives up where it gets
/// softer, by what friction takes, and by a brake. Sliding on to what is harder is braked, as a
/// hand that slides on to a harder body is by its edge; that work makes the spring harder. While
/// the tank is empty the spring stays as it is, so a surface that is changed under a hand at rest
/// changes when the hand comes off. Any way over any border takes at least as much as it gives.
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
