// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// What the ringing of impacts may do beside the safety chain's limit on how fast the force rises,
/// which would smooth it away: a little, briefly and seldom.
///
/// One thread. [servo] O(1); no allocation, lock, system call or exception.
class TransientBudget {
 public:
  static constexpr double largest = 1.0;   ///< [N]
  static constexpr double longest = 0.06;  ///< [s]
  static constexpr double work = 5e-3;     ///< [J] on the hand
  static constexpr double rest = 0.1;      ///< [s] between the beginnings of two

  /// @param t        [s] now
  /// @param hip      [m] world
  /// @param wanted   [N] world: finite
  /// @return [N] world: what may be sent beside the force that the limit on its rise has passed
  // Hazard: impact, material-force
  Vec3 run(double t, const Vec3& hip, const Vec3& wanted) noexcept {
    done_ += std::max(last_.dot(hip - hip_), 0.0);
    hip_ = hip;
    last_.setZero();
    if (wanted.isZero()) return last_;
    // Also where time has run back.
    if (const double since = t - began_; !started_ || since >= rest || since < 0.0) {
      started_ = true;
      began_ = t;
      done_ = 0.0;
    }
    if (!(t - began_ <= longest) || !(done_ <= work)) return last_;
    last_ = wanted;
    if (const double size = wanted.norm(); size > largest) last_ *= largest / size;
    return last_;
  }
  /// None from here on until the next impact: the force has to be zero.
  void end() noexcept {
    last_.setZero();
    done_ = 2.0 * work;
  }

  /// Walks over all that is remembered from tick to tick; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    way("transient.started", self.started_);
    way("transient.began", self.began_);
    way("transient.done", self.done_);
    way("transient.hip", self.hip_);
    way("transient.last", self.last_);
  }

 private:
  // walk() lists all of these.
  bool started_ = false;
  double began_ = 0.0;        // [s] of the ringing in progress, or of the last
  double done_ = 0.0;         // [J] on the hand since then
  Vec3 hip_ = Vec3::Zero();   // [m] of the tick before
  Vec3 last_ = Vec3::Zero();  // [N] allowed in the tick before
};

}  // namespace palpate
