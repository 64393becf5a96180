// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "palpate/kernel/core/vectorise.hpp"

namespace palpate {

// Sums that are the same to the bit whatever the processor: number i goes to lane i modulo 16, each
// lane is summed in order, and the lanes in a tree. How many of them a processor adds at once does
// not matter.

inline constexpr std::size_t sum_lanes = 16;

using FloatLanes = std::array<float, sum_lanes>;

/// The tree's sum of all lanes.
template <class Number>
PALPATE_INLINED Number sum_of_lanes(std::array<Number, sum_lanes> lanes) noexcept {
  for (std::size_t half = sum_lanes / 2; half > 0; half /= 2) {
    for (std::size_t i = 0; i < half; ++i) lanes[i] += lanes[i + half];
  }
  return lanes[0];
}

/// The least number in any lane.
PALPATE_INLINED float least_of_lanes(const FloatLanes& lanes) noexcept {
  float least = lanes[0];
  for (const float lane : lanes) least = lane < least ? lane : least;
  return least;
}

/// Sums of what `terms(i)` gives for i from 0 to below `size`: an array of as many terms as sums.
template <std::size_t sums, class Terms>
std::array<double, sums> sums_over(std::size_t size, const Terms& terms) noexcept {
  std::array<std::array<double, sum_lanes>, sums> lanes{};
  for (std::size_t block = 0; block < size; block += sum_lanes) {
    const std::size_t count = std::min(sum_lanes, size - block);
    for (std::size_t lane = 0; lane < count; ++lane) {
      const std::array<double, sums> here = terms(block + lane);
      for (std::size_t k = 0; k < sums; ++k) lanes[k][lane] += here[k];
    }
  }
  std::array<double, sums> result;
  for (std::size_t k = 0; k < sums; ++k) result[k] = sum_of_lanes(lanes[k]);
  return result;
}

}  // namespace palpate
