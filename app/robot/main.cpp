// SPDX-License-Identifier: Apache-2.0
// palpate-robot: the program with a simulated robot.
#include "app/program.hpp"

int main(int argc, char** argv) {
  return palpate::app::run_program(argc, argv);
}
