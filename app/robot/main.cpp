// SPDX-License-Identifier: Apache-2.0
// palpate-robot: the program with a simulated robot.
#include "app/program.hpp"
#include "app/program_robots.hpp"

#include "robot/simulated_cell.hpp"

namespace palpate::app {

Cell open_cell(const std::string& uri) {
  if (Uri(uri).scheme() != "mujoco") return open_standard_cell(uri);
  const robot::SimulatedCell cell{Uri(uri)};
  return {.robot = [cell] { return cell.robot(); },
          .camera = [cell] { return cell.camera(); },
          .on_frame = [](const FedFrame& /*frame*/) {}};  // both are on the loop's clock
}

std::string usual_cell() { return "mujoco:desk?sensor=d4xx&size=320x240"; }

std::string robots_help() {
  return "robot, with its camera if it has one (" + usual_cell() +
         "): mujoco:desk?KEY=VALUE&...: a simulated arm at a table; " + standard_robots_help();
}

}  // namespace palpate::app

int main(int argc, char** argv) { return palpate::app::run_program(argc, argv); }
