// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// Force Dimension's arms (omega, delta, sigma, lambda) and Novint's Falcon, by Force Dimension's
/// library libdrd or libdhd: `force-dimension:[SERIAL]`, polled.
///
/// Device frame: x to the right, y away from the user, z up, origin in the middle of the workspace.
/// The arm's firmware takes its force away when no force was sent for `watchdog` (20 ms), whatever
/// has become of this process; sessions may rely on it (DeviceInfo::watchdog).
Driver force_dimension_driver();

}  // namespace palpate
