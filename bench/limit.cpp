// SPDX-License-Identifier: Apache-2.0
#include "bench/limit.hpp"

#include "palpate/kernel/core/vectorise.hpp"

namespace palpate::bench {
namespace {

PALPATE_VECTORISED
float add_points(const float* x, const float* y, const float* z, std::size_t size) {
  float sum_x = 0.0F;
  float sum_y = 0.0F;
  float sum_z = 0.0F;
  const std::size_t end = size / Patch::block * Patch::block;
  for (std::size_t i = 0; i < end; ++i) {
    sum_x += x[i];
    sum_y += y[i];
    sum_z += z[i];
  }
  return sum_x + sum_y + sum_z;
}

PALPATE_VECTORISED
std::uint16_t add_pixels(const std::uint16_t* depth, std::size_t columns, std::size_t rows,
                         std::size_t row_length) {
  std::uint16_t sum = 0;  // modulo 65536: as many at once as a register holds
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t i = 0; i < columns; ++i)
      sum = static_cast<std::uint16_t>(sum + depth[row * row_length + i]);
  }
  return sum;
}

}  // namespace

float load_and_add(const Patch& patch) {
  return vectorised<add_points>(patch.x(), patch.y(), patch.z(), patch.padded_size());
}

std::uint16_t load_and_add(const std::uint16_t* depth, std::size_t columns, std::size_t rows,
                           std::size_t row_length) {
  return vectorised<add_pixels>(depth, columns, rows, row_length);
}

}  // namespace palpate::bench
