// SPDX-License-Identifier: Apache-2.0
#include "app/program_robots.hpp"

#include "app/standard_cells.hpp"

namespace palpate::app {

Cell open_cell(const std::string& uri) {
  return open_standard_cell(uri);
}

std::string robots_help() {
  return "what is led, and the camera with it where it has one (" + std::string(usual_cell) +
         "): " + standard_robots_help();
}

}  // namespace palpate::app
