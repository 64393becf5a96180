// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/recorded_hand.hpp"

#include <algorithm>

#include "palpate/record/session_reader.hpp"

namespace palpate {

std::vector<RecordedHand> recorded_hand(const std::filesystem::path& recording, std::size_t most) {
  SessionReader session(recording);
  std::vector<RecordedHand> path;
  const std::size_t count = session.ticks();
  const std::size_t points = std::min(count, std::max<std::size_t>(most, 2));
  for (std::size_t i = 0; i < points; ++i) {
    const Tick tick = session.tick(points == 1 ? 0 : i * (count - 1) / (points - 1)).tick;
    path.push_back({tick.t, tick.hip});
  }
  return path;
}

}  // namespace palpate
