// SPDX-License-Identifier: Apache-2.0
#include "app/program_robots.hpp"

namespace palpate::app {

Cell open_cell(const std::string& uri) { return open_standard_cell(uri); }

std::string usual_cell() { return "synthetic:desk?sensor=d4xx"; }

std::string robots_help() {
  return "robot, with its camera if it has one (" + usual_cell() + "): " + standard_robots_help();
}

}  // namespace palpate::app
