// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// 3D Systems' Touch and Touch X, SensAble's Phantoms, by the HD layer of OpenHaptics (libHD):
/// `touch:[NAME]`, whose scheduler calls the cycle (Device::drives).
///
/// Device frame: x to the right, y away from the user, z up, origin as the vendor has it, in the
/// middle of the workspace. What the hardware does when its computer dies is not documented, so a
/// program holds it by a guard (open_guarded).
Driver open_haptics_driver();

}  // namespace palpate
