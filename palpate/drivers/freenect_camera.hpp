// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// `freenect:` or `freenect:SERIAL`, a Kinect v1 by libfreenect, which is loaded when it is asked
/// for: 640 x 480 at 30 Hz.
///
/// Option `depth`: `mm` (the default), `registered` (to the colour camera's view) or `11bit`, the
/// sensor's own steps, made distances of 0.1 mm here. Stamps are times of arrival: the camera's own
/// are of no documented unit.
Driver freenect_driver();

}  // namespace palpate
