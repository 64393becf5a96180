// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/kernel/core/parameters.hpp"

namespace palpate::test {

/// How many times as long all lengths and all times are.
struct Scale {
  double length = 1.0, time = 1.0;
};

/// The same parameters in a world of another scale. The coupling's stiffness stays, so forces grow
/// with lengths. The damper's filter is a time of the device's: without damping it has no part.
inline Parameters scaled(Parameters p, const Scale& scale) {
  const auto [s, k] = scale;
  p.proxy.r_1 *= s;
  p.proxy.r_2 *= s;
  p.proxy.r_3 *= s;
  p.coupling.max_force *= s;
  p.motion.frame_rate /= k;
  p.motion.max_extrapolation *= k;
  p.sight.hidden_hold *= k;
  p.sight.hidden_fade *= k;
  p.sight.oldest_frame *= k;
  p.sight.hardest_strike *= s / (k * k);
  p.sight.return_speed *= s / k;
  p.sight.detail *= s;
  p.sight.side_depth *= s;
  p.sight.curvature_sd /= s;
  p.sight.usual_noise = SightParameters::unknown_noise / s;
  p.sight.noise_growth = 2;
  return p;
}

}  // namespace palpate::test
