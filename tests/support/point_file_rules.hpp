// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>

#include "palpate/io/sources/point_file.hpp"

namespace palpate::test {

/// What must hold of whatever a reader makes of a file of `size` bytes.
inline bool is_consistent(const PointFile& cloud, std::size_t size) {
  const std::size_t count = cloud.points.size();
  const bool corners =
      std::all_of(cloud.triangles.begin(), cloud.triangles.end(), [&](const auto& triangle) {
        return std::all_of(triangle.begin(), triangle.end(),
                           [&](std::size_t corner) { return corner < count; });
      });
  return corners && count == cloud.width * cloud.height && cloud.non_finite <= count &&
         cloud.bytes_unread <= size && (cloud.normals.empty() || cloud.normals.size() == count);
}

}  // namespace palpate::test
