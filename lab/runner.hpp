// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "lab/experiment.hpp"

namespace palpate::lab {

/// How an experiment's cells are run.
struct RunnerOptions {
  int jobs = 1;         ///< threads of this process
  bool resume = false;  ///< continue from the cells that an interrupted run left behind
  std::function<void(std::size_t done, std::size_t total)> progress;  ///< after every cell
};

/// @param jobs  threads that --jobs asks for; 0: one a core. @throws Error if it is out of range.
int threads_of(int jobs);

/// Runs an experiment and writes its CSV to `file`. Returns the CSV.
///
/// Cells may end in any order; the CSV has them in theirs. Finished cells are kept in FILE.part
/// until the CSV is whole, so an interrupted run can continue.
/// @throws Error if the file cannot be written, or there is nothing that fits to resume.
std::string run_experiment(const Experiment& experiment, const ExperimentOptions& options,
                           const RunnerOptions& runner, const std::filesystem::path& file);

/// The same of any cells: their rows in order, without a header; `file` itself is not written.
/// @param print  identifies the run by its options, one line: what was left is resumed under it
std::string run_cells(const std::vector<Cell>& cells, const std::string& print,
                      const RunnerOptions& runner, const std::filesystem::path& file);

}  // namespace palpate::lab
