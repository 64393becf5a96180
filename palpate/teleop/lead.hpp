// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/patch.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate {

/// Where an operator leads a robot: all that crosses the link from the hand's end.
///
/// The place is the operator's proxy (ServoTick::place), never the HIP: what surfaces and fixtures
/// keep the proxy out of at the operator's end, the robot is never asked to enter.
struct Lead {
  Vec3 place = Vec3::Zero();  ///< [m] world: where the tool is to be
  Vec3 press = Vec3::Zero();  ///< [N] world: with which the operator presses there
  /// Does a hand lead? Not while it is absent, clutched, faulty, or sees nothing any more.
  bool leads = false;
};

/// Of a tick at the operator's end.
Lead lead_of(const ServoTick& tick) noexcept;

}  // namespace palpate
