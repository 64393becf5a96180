// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

namespace palpate::lab {

/// The stiffest spring [N/m] with which a sampled wall stays passive [2]: a device with damping b
/// [N s/m] against a spring K and a damper B held for a period T [s] needs b > K T / 2 + B.
constexpr double passive_stiffness(double device_damping, double damping, double period) {
  return std::max(0.0, 2.0 * (device_damping - damping) / period);
}

}  // namespace palpate::lab
