// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// The ringing of a surface that is struck: a decaying sinusoid along its normal, by which people
/// tell wood from metal (Okamura, Cutkosky and Dennerlein 2001). It adds to what presses the hand
/// out, and is short: the safety chain has a limit of its own for it.
///
/// One strike in `rest`, and only after the hand has been off the surface for `apart`, so that
/// noise that parts hand and surface for a moment is none.
///
/// [servo] Nothing here allocates, locks or throws.
class Tap {
 public:
  static constexpr double largest = 1.0;       ///< [N]
  static constexpr double longest = 0.06;      ///< [s] of ringing
  static constexpr double rest = 0.1;          ///< [s] between the beginnings of two strikes
  static constexpr double apart = 0.05;        ///< [s] off the surface before a strike
  static constexpr double least_speed = 0.03;  ///< [m/s] a slower touch does not ring
  /// [-] of the newest velocity of the hand in its approach, which is averaged over 6 ms: an
  /// encoder's counts of 0.055 mm at 1 kHz are then some 5 mm/s. @param dt  [s] since the last one
  static double approach_share(double dt) noexcept { return dt > 0.0 ? dt / (dt + 6e-3) : 1.0; }

  /// @param pressed   [N] the normal force on the hand
  /// @param normal    [-] unit, away from the surface; zero: no contact
  /// @param approach  [m/s] at which the hand has come towards the surface
  /// @param t         [s] now
  /// @return [N] world: the ringing
  Vec3 update(double pressed, const Vec3& normal, double approach, const TapParameters& material,
              double t) noexcept;
  void reset() noexcept { *this = {}; }

 private:
  static constexpr double never = -1e9;  // [s]

  double touched_at_ = never;  // [s] the last tick with a force
  double struck_at_ = never;   // [s]
  double size_ = 0.0;          // [N] of the ringing at its beginning
  TapParameters material_;     // that was struck
};

}  // namespace palpate
