// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

namespace palpate::lab::field {

/// Random numbers from a seed, the same on every machine: splitmix64.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : state_(seed) {}

  [[nodiscard]] std::uint64_t bits() {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31U);
  }
  /// Evenly from [0, 1).
  [[nodiscard]] double even() { return static_cast<double>(bits() >> 11U) * 0x1p-53; }
  [[nodiscard]] double even(double low, double high) { return low + (high - low) * even(); }
  /// From a normal distribution of mean 0 and deviation 1, cut off at 4 deviations.
  [[nodiscard]] double normal();
  /// Fills `out` with such numbers.
  void fill_normal(std::span<double> out);

 private:
  std::uint64_t state_;
};

}  // namespace palpate::lab::field
