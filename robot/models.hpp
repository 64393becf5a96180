// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace palpate::robot {

/// MJCF of the cell that `mujoco:desk` names, as robot/models/desk.xml has it.
std::string_view desk_model();
/// The same with another hole in the board. @param hole  [m] side, 0.011 to 0.06
std::string desk_model(double hole);

}  // namespace palpate::robot
