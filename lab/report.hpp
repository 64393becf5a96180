// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
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
};

/// Makes the claims from the CSV and draws the figure from the file next to it.
/// @param folder  holds NAME.csv; gets NAME.svg
Result make_result(const Experiment& experiment, const ExperimentOptions& options,
                   std::string_view csv, const std::filesystem::path& folder);

/// The claims, for a terminal.
std::string claims_as_text(const Result& result);

/// Writes report.html, one self-contained page, and reproduction.md into the folder.
/// @return  the page. @throws Error if they cannot be written.
std::filesystem::path write_report(const std::vector<Result>& results,
                                   const std::filesystem::path& folder);

}  // namespace palpate::lab
