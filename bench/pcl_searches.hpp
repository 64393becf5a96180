// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate::bench {

/// One of PCL's searches, on one frame.
struct PclSearch {
  std::string name;
  std::function<void()> build;                     ///< what has to be made of each frame
  std::function<std::size_t(const Ball&)> search;  ///< how many points lie within
};

/// PCL's k-d tree and octree of all points and, of a depth image, its organised search; none
/// where the program was built without PCL.
std::vector<PclSearch> pcl_searches(const Cloud& frame, const std::vector<Vec3>& points);

}  // namespace palpate::bench
