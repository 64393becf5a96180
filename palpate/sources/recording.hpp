// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "palpate/core/uri.hpp"
#include "palpate/sources/source.hpp"

namespace palpate {

/// Opens `recording:PATH`: the frames of a session that palpate recorded, to the bit, or of any bag
/// of ROS 2 (in SQLite or MCAP) or ROS 1 with depth images or points (bag_camera.hpp), a
/// RealSense's among them. Stamps count from the first frame.
///
/// `topic=/NAME` chooses among several topics; `units=1000` is the number of raw depth units per
/// metre, to which depth in floats is rounded (5000: 0.2 mm, up to 13 m); `fixed_frame=odom` is the
/// frame of TF in which points are, and `none` leaves TF aside. Frames for whose time a bag that
/// has TF has no transform are left out. For a frame that cannot be read next() throws an Error;
/// the call after it continues with the next frame.
/// @throws Error if the bag cannot be used, or holds no frames.
std::unique_ptr<Source> open_recording(const Uri& uri);

}  // namespace palpate
