// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace palpate::robot {

/// MJCF of the cell that `mujoco:desk` names, as robot/models/desk.xml has it.
std::string_view desk_model();

}  // namespace palpate::robot
