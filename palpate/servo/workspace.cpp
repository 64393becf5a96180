// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/workspace.hpp"

#include <cmath>
#include <string>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"

namespace palpate {

void validate(const Placement& placement) {
  check_rigid(placement.world_from_device, "world_from_device");
  if (!(placement.workspace_scale >= 1e-3 && placement.workspace_scale <= 1e3)) {
    throw Error("workspace_scale", std::to_string(placement.workspace_scale) + " is out of range",
                "give scene metres per device metre, from 0.001 to 1000");
  }
  if (placement.clutch_button && (*placement.clutch_button < 0 || *placement.clutch_button > 31)) {
    throw Error("clutch_button", std::to_string(*placement.clutch_button) + " is out of range",
                "give a button from 0 to 31");
  }
  if (!(placement.bubble_radius >= 0.0 && placement.bubble_radius <= 1.0))
    throw Error("bubble_radius", std::to_string(placement.bubble_radius) + " is out of range",
                "give metres of the device, from 0 (no bubble) to 1");
  if (!(placement.bubble_speed >= 1e-3 && placement.bubble_speed <= 1.0))
    throw Error("bubble_speed", std::to_string(placement.bubble_speed) + " is out of range",
                "give metres per second in the scene, from 0.001 to 1");
  if (!(placement.handle_weight >= 0.0 && placement.handle_weight <= 0.1))
    throw Error("handle_weight", std::to_string(placement.handle_weight) + " is out of range",
                "give kilograms from 0 (the device holds its handle) to 0.1");
  constexpr double rounding = 1e-3;
  if (!(std::abs(placement.down.norm() - 1.0) <= rounding))
    throw Error("down", "its length is " + std::to_string(placement.down.norm()),
                "give a direction of length 1 in the device's axes, such as 0, 0, -1");
}

}  // namespace palpate
