// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// `realsense:` or `realsense:SERIAL`, by librealsense2, which is loaded when it is asked for.
///
/// Options: `width`, `height` [px] and `fps` [Hz] of the depth, its default otherwise; `colour`
/// adds colour images; `preset` (`default`, `hand`, `high-accuracy`, `high-density`,
/// `medium-density`), `laser` (0: off, else [mW]) and `exposure` [s], which switches automatic
/// exposure off, are left as they are unless given.
///
/// The unit of depth is that of each frame. Stamps of the global and the system's time are on
/// StampClock::system, which shows the camera's latency; a camera that offers neither is followed
/// by its own clock. A frame that says it has the camera's own time all the same, as the first ones
/// after the start do, gets the time at which it arrived.
Driver realsense_driver();

}  // namespace palpate
