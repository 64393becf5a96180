// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "lab/experiment.hpp"

namespace palpate::lab {

/// What an experiment came to.
struct Result {
  const Experiment* experiment;
  std::string command;  ///< that gives this result
  std::vector<Claim> claims;
  std::filesystem::path figure;  ///< SVG; empty where gnuplot is not installed
  std::optional<Scores> scores;  ///< of a bench
};

/// Makes the claims from the CSV and draws the figure from the file next to it.
/// @param folder  holds NAME.csv; gets NAME.svg
Result make_result(const Experiment& experiment, const ExperimentOptions& options,
                   std::string_view csv, const std::filesystem::path& folder);

/// The claims and the scores, for a terminal.
std::string result_as_text(const Result& result);

/// Writes report.html, one self-contained page, into the folder, and as tables for the
/// documentation reproduction.md (what redraws the paper) and bench.md (benches).
/// @return  the page. @throws Error if they cannot be written.
std::filesystem::path write_report(const std::vector<Result>& results,
                                   const std::filesystem::path& folder);

}  // namespace palpate::lab
