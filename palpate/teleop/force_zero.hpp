// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "palpate/core/patch.hpp"

namespace palpate {

/// Removes the bias of a robot's force sensor in free space: otherwise the robot would treat its
/// drift and the weight of the tool as a contact and retreat.
///
/// The force in free space is averaged over 2 s and subtracted: all of it in the first half second,
/// then only values within 1 N of it. A sudden force in free space is a contact with an object that
/// the camera does not see, not drift. [one thread]
class ForceZero {
 public:
  static constexpr double clear = 0.03;     ///< [m] nothing is nearer to a tool in free space
  static constexpr double largest = 20.0;   ///< [N] more is no error of a sensor
  static constexpr double drift = 1.0;      ///< [N] more is a contact
  static constexpr double first = 0.5;      ///< [s]
  static constexpr double averaging = 2.0;  ///< [s]

  /// @param t      [s] later than before
  /// @param force  [N] world: as it is measured
  /// @param free   the proxy is in free space, and nothing that is seen is nearer than `clear`
  /// @return [N] world: without what is measured in free space
  Vec3 next(double t, const Vec3& force, bool free) noexcept {
    const double dt = began_ ? std::clamp(t - last_t_, 0.0, 0.02) : 0.0;
    began_ = true;
    last_t_ = t;
    if (!force.allFinite()) return force;
    const bool is_error = known_ < first ? force.norm() < largest : (force - zero_).norm() < drift;
    if (free && is_error && dt > 0.0) {
      known_ = std::min(known_ + dt, averaging);
      zero_ += std::min(dt / known_, 1.0) * (force - zero_);
    }
    return force - zero_;
  }

 private:
  Vec3 zero_ = Vec3::Zero();  // [N]
  double known_ = 0.0;        // [s] that are in it
  double last_t_ = 0.0;       // [s]
  bool began_ = false;
};

}  // namespace palpate
