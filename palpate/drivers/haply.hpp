// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// Haply's Inverse3, Inverse3x and Minverse, by their Inverse Service: `haply:[DEVICE_ID]`, JSON
/// over a WebSocket on a thread of its own, so that a service that hangs never holds a tick.
///
/// Device frame: x to the right, y away from the user, z up, origin in the middle of the workspace.
/// What the service does with the last force when it is not spoken to any more is not documented
/// with a time, so a program holds it by a guard (open_guarded).
Driver haply_driver();

}  // namespace palpate
