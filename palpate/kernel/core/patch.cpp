// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/patch.hpp"

#include <limits>

namespace palpate {

Patch::Patch() : points_(std::make_unique<Points>()) {}

double clear_travel(const Patch& patch, const Vec3& at, const Vec3& direction,
                    double r_c) noexcept {
  const float travel = smallest_travel(patch.points(), patch.relative(at), narrow(direction),
                                       static_cast<float>(r_c * r_c), Patch::far);
  // A far point that happens to lie ahead is met far away, too.
  return travel > 0.1F * Patch::far ? std::numeric_limits<double>::infinity() : double{travel};
}

double escape_travel(const Patch& patch, const Vec3& at, const Vec3& direction,
                     const ProxyParameters& proxy) noexcept {
  return largest_escape(patch.points(), patch.relative(at), narrow(direction),
                        static_cast<float>(proxy.r_1 * proxy.r_1),
                        static_cast<float>(proxy.r_c() * proxy.r_c()));
}

}  // namespace palpate
