// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/patch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/patch_loops.hpp"

namespace palpate {
namespace {

Float3 relative(const Vec3& at, const Patch& patch) {
  const Vec3 p = at - patch.ball().centre;
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

Float3 narrow(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

PointArrays points_of(const Patch& patch) {
  return {patch.x(), patch.y(), patch.z(), patch.padded_size()};
}

}  // namespace

Patch::Patch() : points_(std::make_unique<Points>()) {}

double wendland_weight(double r, const ProxyParameters& proxy) {
  const double t = std::clamp((r - proxy.r_1) / (proxy.r_3 - proxy.r_1), 0.0, 1.0);
  return std::pow(1.0 - t, 4) * (4.0 * t + 1.0);  // Eq. (2)
}

ContactSums contact_sums(const Patch& patch, const Vec3& at,
                         const ProxyParameters& proxy) noexcept {
  const DirectionSums sums =
      sum_directions(points_of(patch), relative(at, patch), static_cast<float>(proxy.r_3),
                     static_cast<float>(1.0 / (proxy.r_3 - proxy.r_1)));
  const auto [x, y, z] = sums.direction;
  return {Vec3(x, y, z), patch.size() == 0 ? std::numeric_limits<double>::infinity()
                                           : std::sqrt(double{sums.nearest_squared})};
}

double clear_travel(const Patch& patch, const Vec3& at, const Vec3& direction,
                    double r_c) noexcept {
  const float travel = smallest_travel(points_of(patch), relative(at, patch), narrow(direction),
                                       static_cast<float>(r_c * r_c), Patch::far);
  // A far point that happens to lie ahead is met far away, too.
  return travel > 0.1F * Patch::far ? std::numeric_limits<double>::infinity() : double{travel};
}

double escape_travel(const Patch& patch, const Vec3& at, const Vec3& direction,
                     const ProxyParameters& proxy) noexcept {
  return largest_escape(points_of(patch), relative(at, patch), narrow(direction),
                        static_cast<float>(proxy.r_1 * proxy.r_1),
                        static_cast<float>(proxy.r_c() * proxy.r_c()));
}

}  // namespace palpate
