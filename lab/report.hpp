// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lab/experiment.hpp"

namespace palpate::lab {

/// What an experiment came to.
struct Result {
  const Experiment* experiment;
  std::string command;  ///< that gives this result
  std::vector<Claim> claims = {};
  std::optional<Scores> scores = {};  ///< of a bench
};

/// Makes claims and scores from the CSV.
Result make_result(const Experiment& experiment, const ExperimentOptions& options,
                   std::string_view csv);

/// The claims and the scores, for a terminal.
std::string result_as_text(const Result& result);

/// Writes tables for the documentation into the folder, with their figures as images/NAME.svg:
/// reproduction.md of what redraws the paper, bench.md of benches.
/// @throws Error if they cannot be written.
void write_report(const std::vector<Result>& results, const std::filesystem::path& folder);

}  // namespace palpate::lab
