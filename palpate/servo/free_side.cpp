// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/free_side.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

// Hazard: late-loop
Vec3 free_side(const Cloud& cloud, const Vec3& proxy, const Vec3& normal, double r_c,
               Patch& patch) noexcept {
  constexpr double reach = 0.05;  // [m] 1.5 m/s for one frame at 30 Hz
  gather(cloud, Ball{proxy, reach + r_c}, patch);

  Vec3 outwards = normal;
  for (std::size_t i = 0; i < patch.view_count(); ++i) {
    if (patch.view(i).begin == patch.view_end(i) || !patch.view(i).viewpoint) continue;
    outwards = *patch.view(i).viewpoint - proxy;
    break;
  }
  const double length = outwards.norm();
  if (!(length > 0.0)) return proxy;
  outwards /= length;

  double travel = 0.0;
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const Vec3 point(patch.x()[i], patch.y()[i], patch.z()[i]);
    const double height = point.dot(outwards);
    const double squared_room = r_c * r_c - (point.squaredNorm() - height * height);
    if (squared_room > 0.0) travel = std::max(travel, height + std::sqrt(squared_room));
  }
  return proxy + std::min(travel, length) * outwards;
}

}  // namespace palpate
