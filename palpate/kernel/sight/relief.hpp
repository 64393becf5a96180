// SPDX-License-Identifier: Apache-2.0
// How averaged points follow their frames: sight's pixels and a tool's cells. docs/sight.md, 5.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "palpate/kernel/core/lanes.hpp"
#include "palpate/kernel/sight/surface_fit.hpp"

namespace palpate {

/// Where a frame's points are, above their relief.
struct Level {
  float height;  ///< [m]
  float share;   ///< [-] of the points that are near it
};

/// The mean of the points near their median: where depth is rounded, a median alone jumps by a good
/// part of the step.
/// @param heights  [m] of a frame's points above their relief; at least one
/// @param spread   [m] of them so far; 0: not known yet
inline Level level_of(std::span<const float> heights, float spread) noexcept {
  constexpr float near = 4.0F;  // [-] spreads
  const float median = kth_smallest(heights, heights.size() / 2);
  if (spread == 0.0F) return {median, 1.0F};
  const auto [sum, count] = sums_over<2>(heights.size(), [&](std::size_t i) {
    const float off = heights[i] - median;
    const bool counts = std::abs(off) <= near * spread;  // the median's own does
    return std::array{counts ? double{off} : 0.0, counts ? 1.0 : 0.0};
  });
  return {median + static_cast<float>(sum / count),
          static_cast<float>(count / static_cast<double>(heights.size()))};
}

/// [m] The spread of points about their level and relief, after one frame more.
/// @param spread           [m] before; 0: this is the first frame
/// @param level            [m] of the frame
/// @param heights          [m] of its points above their relief; their order changes
/// @param units_per_metre  of the image: no spread is less than half a step of the depth
inline float next_spread(float spread, float level, std::span<float> heights,
                         double units_per_metre) noexcept {
  constexpr float most_growth = 1.1F;  // [-] of it in a frame: what is new there is not noise
  constexpr float newest = 0.2F;       // [-] weight of the newest frame
  const float deviation =
      std::max(deviation_about<float>(level, heights), static_cast<float>(0.5 / units_per_metre));
  return spread == 0.0F ? deviation
                        : std::min(spread + newest * (deviation - spread), most_growth * spread);
}

/// Takes a reading into one point's relief: a mean, which begins again where readings contradict
/// it.
/// @param above        [m] the reading above the frame's level
/// @param spread       [m] standard deviation of one reading
/// @param most_frames  [-] in a mean
/// @param relief       [m] above the level
/// @param drift        [m] mean of the newest deviations from it
/// @param frames       [-] in the relief; 0: it is not known yet
inline void follow_relief(float above, float spread, float most_frames, float& relief, float& drift,
                          float& frames) noexcept {
  // [-] Weight of the newest deviation in the drift, which so is a mean over some seven frames.
  constexpr float newest_weight = 0.25F;
  // [-] 4.5 standard deviations of such a mean, in multiples of one reading's: noise alone exceeds
  // that a few times a minute among a thousand points.
  constexpr float most_drift = 1.7F;
  constexpr float drift_frames = 4.0F;  // that a drift is worth
  // [-] standard deviations: what is beyond is an outlier, and counts as if it were so far off.
  constexpr float outlier = 4.0F;
  const float off = above - relief;
  const float counts = std::clamp(off, -outlier * spread, outlier * spread);
  const float newest = drift + newest_weight * (counts - drift);
  const bool drifts = std::abs(newest) > most_drift * spread;
  drift = 0.0F;
  if (frames == 0.0F || (drifts && counts != off)) {  // another surface
    relief = above;
    frames = 1.0F;
  } else if (drifts) {
    relief += newest;
    frames = std::min(frames, drift_frames);
  } else {
    frames = std::min(frames + 1.0F, most_frames);
    relief += counts / frames;
    drift = newest;
  }
}

}  // namespace palpate
