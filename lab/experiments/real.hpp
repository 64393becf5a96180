// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "lab/experiment.hpp"
#include "lab/experiments/pop.hpp"

namespace palpate::lab {

/// One case on a recording: a place and a motion drawn at random.
struct RealCase {
  std::string text;  ///< all that was drawn
  std::function<Judgement(const std::string& method, const ExperimentOptions& options)> play;
};

struct RealCases {
  std::string hash;    ///< SHA-256 of the recording's frames
  std::size_t frames;  ///< that are taken of it
  std::vector<RealCase> cases;
};

/// Cases on the recording of a camera at rest: they follow from its frames, the seed and their
/// number alone, the motions composed exactly.
/// @param name  what the recording is called in the cases' texts
/// @throws Error if it cannot be read, its camera moved, or it shows nothing flat.
RealCases draw_real_cases(const std::string& uri, const std::string& name, std::uint64_t seed,
                          std::size_t count);

}  // namespace palpate::lab
