// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "palpate/servo/device.hpp"

namespace palpate {

/// What speaks against a stiffness on a device, a sentence with the remedy each: walls stiffer than
/// its nominal ones, or than 2 b / (T + 2 t_d), above which a handle that nobody holds may swing.
/// Empty for a device without motors, a simulated one, and where the figures are unknown.
/// @param stiffness  [N/m] of the coupling
/// @param scale      [-] of the workspace: forces are not scaled, so the hand feels as many times
///                   that stiffness
/// @param rate       [Hz] of the ticks
std::vector<std::string> stiffness_warnings(const DeviceInfo& device, double stiffness,
                                            double scale, double rate);

}  // namespace palpate
