// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "lab/method.hpp"
#include "lab/runner.hpp"

namespace palpate::lab {

/// What an entry of the bench is made from: docs/bench-entries.md.
struct EntryOptions {
  std::string method;                   ///< of the lab, of `own_methods`, or pipe:COMMAND
  std::uint64_t seed = 0;               ///< that the cases are drawn from
  int cases = 25;                       ///< of each family, and of the recordings
  int repeats = 5;                      ///< of each scene of `fidelity`, in each of four parts
  std::vector<std::string> recordings;  ///< URIs of recordings of cameras at rest
  std::vector<OwnMethod> own_methods;
};

/// What an entry says of the machine and the time; no score follows from it.
using EntryRun = std::vector<std::pair<std::string, std::string>>;

/// Plays a method on the whole bench and writes the entry, a JSON text. The same options give the
/// same entry, byte for byte, with any number of threads and ranks, but for its part "run".
/// @param file  is written by rank 0
/// @return its text; empty on other ranks
/// @throws Error for options that cannot be, or what the method threw.
std::string make_entry(const EntryOptions& options, const EntryRun& run,
                       const RunnerOptions& runner, const std::filesystem::path& file);

/// What came of playing a part of an entry again.
struct EntryCheck {
  std::size_t played = 0;                ///< cases and scenes
  std::size_t entered = 0;               ///< that the entry has of them
  std::vector<std::string> differences;  ///< one line each: what was played and how it differs
  std::vector<std::string> faults;       ///< where the entry contradicts itself, or this program
  std::vector<std::string> left_out;     ///< recordings that are not here
  bool holds = false;                    ///< no fault, and at most one difference in twenty
};

/// Draws an entry's cases again, holds its hashes and scores against its outcomes, and plays some.
/// @param sample       how many cases and scenes; more than it has: all
/// @param chance       picks them
/// @param recordings   URIs of the recordings that it was made with, in any order
/// @param own_methods  one that has the entry's name, if the lab does not have it
/// @throws Error if the file is no entry, or its method is not known here.
EntryCheck check_entry(const std::filesystem::path& file, std::size_t sample, std::uint64_t chance,
                       const std::vector<std::string>& recordings,
                       const std::vector<OwnMethod>& own_methods, const RunnerOptions& runner);

}  // namespace palpate::lab
