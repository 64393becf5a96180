// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "palpate/servo/device.hpp"

namespace palpate {

/// Returns warnings about a stiffness, each with a remedy: if it exceeds the rated stiffness of the
/// device, or 2 b / (T + 2 t_d), above which a released handle may oscillate. Empty for a device
/// without motors, a simulated device, or unknown device data.
/// @param stiffness  [N/m] of the coupling
/// @param scale      [-] of the workspace: forces are not scaled, so the hand feels as many times
///                   that stiffness
/// @param rate       [Hz] of the ticks
std::vector<std::string> stiffness_warnings(const DeviceInfo& device, double stiffness,
                                            double scale, double rate);

}  // namespace palpate
