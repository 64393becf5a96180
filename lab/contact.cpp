// SPDX-License-Identifier: Apache-2.0
#include "lab/contact.hpp"

#include <algorithm>

#include "palpate/kernel/core/linear.hpp"

namespace palpate::lab {

std::optional<Contact> fit_plane(const Patch& patch, double radius) {
  double total = 0.0;
  Vec3 mean = Vec3::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const Vec3 x(patch.x()[i], patch.y()[i], patch.z()[i]);
    const double q = std::max(1.0 - x.norm() / radius, 0.0);
    const double w = q * q * q * q * (4.0 * (1.0 - q) + 1.0);  // Wendland's C2 function
    total += w;
    mean += w * x;
    second += w * x * x.transpose();
  }
  if (patch.size() < 6 || !(total > 1e-12)) return std::nullopt;
  mean /= total;
  Vec3 normal = axes_of(second / total - mean * mean.transpose()).vectors.col(0);
  const Vec3 at = patch.ball().centre + mean;
  const auto& seen_from = patch.view(0).viewpoint;
  const Vec3 outward = seen_from ? Vec3(*seen_from - at) : Vec3(Vec3::UnitZ());
  if (normal.dot(outward) < 0.0) normal = -normal;
  return Contact{at, normal};
}

}  // namespace palpate::lab
