// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>

#include "palpate/kernel/core/patch_loops.hpp"
#include "palpate/kernel/core/vectorise.hpp"

namespace palpate {

// Sums that are the same to the bit whatever the processor: number i goes to lane i modulo 16, each
// lane is summed in order, and the lanes in a tree. How many of them a processor adds at once does
// not matter.

inline constexpr std::size_t sum_lanes = 16;
static_assert(patch_block % sum_lanes == 0);  // loops over a patch have no remainder

using FloatLanes = std::array<float, sum_lanes>;

/// The tree's sum of all lanes.
template <class Number>
PALPATE_INLINED Number sum_of_lanes(std::array<Number, sum_lanes> lanes) noexcept {
  for (std::size_t half = sum_lanes / 2; half > 0; half /= 2) {
    for (std::size_t i = 0; i < half; ++i) lanes[i] += lanes[i + half];
  }
  return lanes[0];
}

namespace detail {
// Four floats as every processor has them: compilers make scalar code of a tree over an array.
using Four = float __attribute__((vector_size(16)));
PALPATE_INLINED Four four_of(const FloatLanes& lanes, std::size_t first) noexcept {
  Four four;
  std::memcpy(&four, lanes.data() + first, sizeof four);
  return four;
}
}  // namespace detail

/// The same for floats, in a few instructions.
template <>
PALPATE_INLINED float sum_of_lanes(FloatLanes lanes) noexcept {
  using detail::four_of;
  const detail::Four sum =
      (four_of(lanes, 0) + four_of(lanes, 8)) + (four_of(lanes, 4) + four_of(lanes, 12));
  return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

/// The least number in any lane.
PALPATE_INLINED float least_of_lanes(const FloatLanes& lanes) noexcept {
  detail::Four least = detail::four_of(lanes, 0);
  for (std::size_t first = 4; first < sum_lanes; first += 4) {
    const detail::Four other = detail::four_of(lanes, first);
    least = other < least ? other : least;
  }
  const float a = least[0] < least[2] ? least[0] : least[2];
  const float b = least[1] < least[3] ? least[1] : least[3];
  return a < b ? a : b;
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
