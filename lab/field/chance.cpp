// SPDX-License-Identifier: Apache-2.0
#include "lab/field/chance.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace palpate::lab::field {
namespace {

constexpr unsigned table_bits = 14;

// The normal distribution's quantiles at (i + 1/2) / 2^14, by Newton's method from the one before.
const std::vector<double>& normal_quantiles() {
  static const std::vector<double> table = [] {
    constexpr std::size_t size = std::size_t{1} << table_bits;
    std::vector<double> quantiles(size);
    double x = 0.0;
    for (std::size_t i = size / 2; i < size; ++i) {
      const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(size);
      for (int round = 0; round < 8; ++round) {
        const double above = 0.5 * std::erfc(x / std::numbers::sqrt2);
        const double density = std::exp(-0.5 * x * x) / std::sqrt(2.0 * std::numbers::pi);
        x += (share - 1.0 + above) / density;
      }
      quantiles[i] = x;
      quantiles[size - 1 - i] = -x;
    }
    return quantiles;
  }();
  return table;
}

}  // namespace

double Chance::normal() {
  return normal_quantiles()[bits() >> (64U - table_bits)];
}

void Chance::fill_normal(std::span<double> out) {
  const std::vector<double>& table = normal_quantiles();
  constexpr std::uint64_t mask = (std::uint64_t{1} << table_bits) - 1;
  std::uint64_t word = 0;
  for (std::size_t i = 0; i < out.size(); ++i) {
    word = i % 4 == 0 ? bits() : word >> 16U;
    out[i] = table[word & mask];
  }
}

}  // namespace palpate::lab::field
