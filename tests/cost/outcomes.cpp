// SPDX-License-Identifier: Apache-2.0
// Prints what the bench's cases come to, without threads: `outcomes EXPERIMENT CASES METHOD...`, a
// row of its CSV each. For processors and systems that are not this machine's.
#include <cstdio>
#include <cstdlib>

#include "lab/experiment.hpp"

int main(int argc, char** argv) {
  using namespace palpate::lab;
  if (argc < 4) return 2;
  const Experiment& experiment = find_experiment(argv[1]);
  ExperimentOptions options;
  options.cases = std::atoi(argv[2]);
  options.methods.assign(argv + 3, argv + argc);
  for (const Cell& cell : experiment.cells(experiment, options)) std::fputs(cell().c_str(), stdout);
}
