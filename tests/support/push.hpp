// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/servo/last_gate.hpp"

namespace palpate::test {

/// Asks a guarded device for a force [N] along z, as a safety chain does that allows to push at
/// once.
inline void push(Device& device, double newtons, double t) {
  palpate_gate_wish wish{};
  wish.t = t;
  wish.force.z = newtons;
  wish.lost_age = wish.late_intervals = 1.0;  // [s], [intervals]
  wish.force_bounds = {3.3, 1e6, 1e6};
  wish.ramp_time = 1e-3;
  wish.longest_gap = 0.1;
  wish.longest_time = 1e-3;
  wish.engaged = wish.hand = 1;
  device.announce(wish);
  device.write(Vec3::Zero(), t);
}

}  // namespace palpate::test
