// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "palpate/kernel/core/parameters.hpp"
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

/// Sets the largest stiffness of a tool in rotation that a device's motors for a torque bear, where
/// it is not set (0): their full torque comes at a turn of 0.4 rad. A handle of 1e-4 kg m^2 whose
/// damping of 3e-3 N m s/rad is mostly that of two light fingers bears 4 N m/rad at 1 kHz
/// (`largest_stiffness`); one that nobody holds 1.3, and one with motors of 0.4 N m gets 1.
constexpr void set_turn_stiffness(const DeviceLimits& device, Coupling& coupling) {
  constexpr double full_torque = 0.4;  // [rad]
  if (coupling.turn_stiffness == 0.0 && device.max_torque > 0.0)
    coupling.turn_stiffness = device.max_torque / full_torque;
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
