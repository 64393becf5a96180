// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// `openni2:`, `openni2:SERIAL` or `openni2:FILE.oni`, by OpenNI2's C interface, which is loaded
/// when it is asked for: Kinect v1, Xtion, Carmine, Astra. A path may also be an address as
/// OpenNI2 lists it.
///
/// Options: `width`, `height` [px] and `fps` [Hz] of the depth, otherwise the largest
/// size up to 640 x 480; `colour` adds colour images, with the depth registered to them by the
/// device. Mirroring, on by default in OpenNI2, is switched off. A recording plays at its own pace.
Driver openni2_driver();

}  // namespace palpate
