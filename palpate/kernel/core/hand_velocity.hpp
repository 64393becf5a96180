// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// The hand's velocity by differences of its positions, low-pass filtered.
///
/// [servo] Nothing here allocates, locks or throws.
class HandVelocity {
 public:
  /// A tick at `t` [s] with the hand at `hip` [m, world].
  void update(const Vec3& hip, double t) noexcept {
    const double dt = t - t_;
    if (hip_ && dt > 0.0 && dt < longest_gap) {
      velocity_ += -math::expm1(-dt / time_constant) * ((hip - *hip_) / dt - velocity_);
    } else if (!hip_ || dt != 0.0) {
      velocity_ = Vec3::Zero();
    }
    hip_ = hip;
    t_ = t;
  }
  void reset() noexcept { hip_.reset(); }
  /// Has there been a tick since the beginning or the last reset?
  [[nodiscard]] bool started() const noexcept { return hip_.has_value(); }

  [[nodiscard]] const Vec3& value() const noexcept { return velocity_; }  ///< [m/s] world
  [[nodiscard]] double t() const noexcept { return t_; }                  ///< [s] of the last tick

 private:
  // [s] A device that resolves 0.055 mm at 1 kHz shows steps of 55 mm/s: they are averaged over a
  // few ticks, and a hand's motion, slower than some 30 Hz, is not delayed.
  static constexpr double time_constant = 2e-3;
  static constexpr double longest_gap = 20e-3;  // [s] over more, differences are no velocity

  std::optional<Vec3> hip_;
  double t_ = 0.0;
  Vec3 velocity_ = Vec3::Zero();
};

}  // namespace palpate
