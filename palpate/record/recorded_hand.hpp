// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// Where the hand was at a time of a recorded session.
struct RecordedHand {
  double t = 0.0;           ///< [s] of the session's clock, as the frames' stamps
  Vec3 hip = Vec3::Zero();  ///< [m] world
};

/// The path of the hand in a recording of palpate's, at evenly spaced ticks, the last included.
/// @param most  of them, at least 2
/// @throws Error if it is no such recording, or damaged.
std::vector<RecordedHand> recorded_hand(const std::filesystem::path& recording, std::size_t most);

}  // namespace palpate
