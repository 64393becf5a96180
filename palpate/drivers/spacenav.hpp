// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// 3Dconnexion's SpaceMouse and the like, by libspnav and its daemon spacenavd: `spacenav:`. It
/// moves the hand by rate control and gives no force.
Driver spacenav_driver();

}  // namespace palpate
