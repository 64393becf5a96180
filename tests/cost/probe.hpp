// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

/// What the kernel's loops say about fixed scenes; the clones compile it again for each set.
struct Probe {
  std::vector<std::size_t> points;  ///< per gather
  std::vector<double> sums;         ///< coordinates, sums, distances and travels
};

namespace palpate {
Probe probe();
}  // namespace palpate
