// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/patch.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate {

/// Teleoperation command: all data that the operator's end sends.
///
/// The position is the operator's proxy (ServoTick::place), never the HIP: the robot is never
/// commanded into surfaces and fixtures that stop the proxy at the operator's end.
struct Lead {
  Vec3 place = Vec3::Zero();  ///< [m] world: where the tool is to be
  Vec3 press = Vec3::Zero();  ///< [N] world: with which the operator presses there
  /// Is the command valid? Not while the device is released, clutched or faulty, or without frames.
  bool leads = false;
};

/// Of a tick at the operator's end.
Lead lead_of(const ServoTick& tick) noexcept;

}  // namespace palpate
