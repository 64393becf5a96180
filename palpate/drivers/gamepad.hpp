// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// A game controller by SDL2: `gamepad:[INDEX]`. Its left stick moves the hand sideways and away,
/// its right stick up and down, by rate control; a contact is felt as rumble.
Driver gamepad_driver();

}  // namespace palpate
