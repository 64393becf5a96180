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
  std::filesystem::path figure;  ///< SVG
  std::optional<Scores> scores;  ///< of a bench
};

/// Makes the claims and the figure from the CSV.
/// @param folder  gets NAME.svg. @throws Error if that cannot be written.
Result make_result(const Experiment& experiment, const ExperimentOptions& options,
                   std::string_view csv, const std::filesystem::path& folder);

/// Draws a CSV that `eval`, `bench --growth` or `trace` wrote.
/// @param csv  NAME.csv of the experiment NAME, growth.csv or a trace of any name
/// @return  the SVG beside it. @throws Error if it is none of them or cannot be written.
std::filesystem::path draw(const std::filesystem::path& csv);

/// The claims, the scores and where the figure is, for a terminal.
std::string result_as_text(const Result& result);

/// Writes report.html, one self-contained page, into the folder, and as tables for the
/// documentation reproduction.md (what redraws the paper) and bench.md (benches).
/// @return  the page. @throws Error if they cannot be written.
std::filesystem::path write_report(const std::vector<Result>& results,
                                   const std::filesystem::path& folder);

}  // namespace palpate::lab
