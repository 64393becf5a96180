// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace palpate {

/// What the kernel's loops say about fixed scenes.
struct Probe {
  std::vector<std::size_t> points;  ///< per gather
  std::vector<double> sums;         ///< coordinates, sums, distances and travels
};

Probe probe();

}  // namespace palpate
