// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "palpate/servo/device.hpp"

namespace palpate {

/// [N/m] 2 b / (T + 2 t_d): stiffer walls may generate energy, so that a released handle
/// oscillates.
/// @param damping  [N s/m] b of the device
/// @param period   [s] T between ticks
/// @param delay    [s] t_d from the reading of the position to the force
constexpr double largest_stiffness(double damping, double period, double delay) {
  return 2.0 * damping / (period + 2.0 * delay);
}

/// Returns warnings about a stiffness, each with a remedy: if it exceeds the rated stiffness of the
/// device, or largest_stiffness. Empty for a device without motors, a simulated device, or unknown
/// device data.
/// @param stiffness  [N/m] of the coupling
/// @param scale      [-] of the workspace: forces are not scaled, so the hand feels as many times
///                   that stiffness
/// @param rate       [Hz] of the ticks
std::vector<std::string> stiffness_warnings(const DeviceInfo& device, double stiffness,
                                            double scale, double rate);

}  // namespace palpate
