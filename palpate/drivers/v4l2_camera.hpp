// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// `v4l2:/dev/videoN?intrinsics=FILE.json`, a depth camera that the kernel itself drives: a node
/// that gives Z16, as the RealSense D400 series does.
///
/// V4L2 tells neither lens nor unit: FILE.json does (intrinsics_file.hpp), and its size is the one
/// that is asked for. Option `fps` [Hz]. Stamps are the kernel's, on StampClock::monotonic, as all
/// drivers of cameras in it have them: when a frame's first or last bytes arrived.
Driver v4l2_driver();

}  // namespace palpate
