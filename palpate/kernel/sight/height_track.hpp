// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "palpate/kernel/core/parameters.hpp"

namespace palpate {

/// One frame's measurement of a surface's height at one place.
struct HeightSample {
  double stamp;        ///< [s]
  double height;       ///< [m]
  double doubt = 1.0;  ///< [-] its variance over the usual one
};

/// Where a surface is and how it moves.
struct HeightTrack {
  double height;    ///< [m] now
  double velocity;  ///< [m/s] leads to where it will be one frame later; 0 while it rests
};

/// How far a surface has moved [m] `elapsed` [s] after its frame, with `velocity` [m/s]: beyond one
/// and a half intervals [s] the velocity fades over another, and it stays there.
double moved_since(double velocity, double elapsed, double interval) noexcept;

/// The most heights that are looked at; older ones are left out.
inline constexpr std::size_t most_heights = 128;

/// The height of a surface at rest [m], averaged over as much of the past as agrees with the
/// present.
///
/// From the longest mean (all heights) to the newest height alone, each shorter mean limits the
/// estimate to `confidence` standard deviations about itself. So at rest the error falls with the
/// square root of the frames, and of a moving surface the estimate lags by no more than the noise
/// of short means.
/// @param newest_first  heights measured
/// @param sd            [m] usual standard deviation of one of them
double agreed_height(std::span<const HeightSample> newest_first, double sd,
                     double confidence) noexcept;

/// Estimates height and motion from measured heights.
///
/// A bank of filters runs over the heights: one for a surface at rest, and Kalman filters for
/// steps of velocity and for jerks from small to very large, in multiples of `detail` and of the
/// time between heights. Each is weighted by the likelihood of its innovations over the last
/// frames, rest with a higher prior and jerks with a lower one. The height is the bank's mean,
/// within `confidence` standard deviations of the newest measurement. O(most_heights), no
/// allocation.
/// @param newest_first  heights measured; at least one
/// @param sd            [m] usual standard deviation of one of them
/// @param interval      [s] until the next frame
HeightTrack track_height(std::span<const HeightSample> newest_first, double sd, double interval,
                         const SightParameters& parameters = {}) noexcept;

}  // namespace palpate
