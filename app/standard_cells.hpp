// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "app/program_robots.hpp"

namespace palpate::app {

/// What every program can lead: the library's robots, and a tool in a synthetic scene.
/// @throws Error as open_cell.
Cell open_standard_cell(const std::string& uri);

/// What those are, as one part of the help of --robot.
std::string standard_robots_help();

}  // namespace palpate::app
