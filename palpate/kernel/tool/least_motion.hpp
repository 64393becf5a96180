// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include <Eigen/Core>

namespace palpate {

/// A motion of a tool: a translation and a rotation vector times a length, [m].
using Motion6 = Eigen::Matrix<double, 6, 1>;

/// A half-space that a motion must stay in: direction . motion >= least.
struct MotionLimit {
  Motion6 direction;
  double least;  ///< [m]
};

/// What pushes a motion to where it ends: of each limit that holds it, its number and its share.
struct HeldBy {
  std::size_t count = 0;
  std::array<std::size_t, 6> limit{};
  std::array<double, 6> push{};  ///< [m] >= 0: the motion is `wanted` + sum of push * direction
  bool all_met = true;  ///< false: limits contradict one another, or the steps were used up
};

/// More limits than that are left out: a tool's contacts, and the friction of some twenty.
inline constexpr std::size_t most_motion_limits = 160;

/// The motion nearest to the wanted one within all limits: equation (3) of docs/tools.md, by the
/// dual method of Goldfarb and Idnani (1983) with the identity as its matrix. Where limits
/// contradict one another, the more violated ones come first. At most 40 steps.
///
/// [servo] Bounded, no allocation; the same bits everywhere.
/// @param motion  in: as wanted; out: the nearest
HeldBy least_motion(std::span<const MotionLimit> limits, Motion6& motion) noexcept;

}  // namespace palpate
