// SPDX-License-Identifier: Apache-2.0
// The direct method of section 2.1 on the surface of [7]: a force in proportion to the depth of the
// HIP below a moving-least-squares plane, no proxy and no memory.
#include <algorithm>
#include <optional>

#include "lab/local_points.hpp"
#include "lab/method.hpp"

namespace palpate::lab {
namespace {

class Direct final : public LabMethod {
 public:
  explicit Direct(const Parameters& parameters) : LabMethod(parameters) {}

  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick = free(hip, t);
    if (seen() == nullptr) return tick;
    // The HIP is deep in the surface when a hand presses hard: the radius has to reach the surface
    // from there. Seven r_c is generous to the method.
    const double radius = 7.0 * parameters().proxy.r_c();
    gather(*seen(), Ball{hip, radius}, patch_);
    const std::optional<Contact> plane = fit_plane(patch_, radius);
    if (!plane) return tick;
    tick.normal = plane->normal;
    const double distance = plane->normal.dot(hip - plane->point);
    if (distance >= 0.0) return tick;
    const double magnitude =
        std::min(-parameters().coupling.stiffness * distance, parameters().coupling.max_force);
    tick.force = magnitude * plane->normal;
    tick.proxy = hip + (parameters().proxy.r_c() - distance) * plane->normal;
    tick.state = ContactState::contact;
    return tick;
  }

 private:
  Patch patch_;
};

}  // namespace

std::vector<MethodInfo> direct_methods() {
  return {{"direct", "penalty force on a moving-least-squares surface (2.1, [7])", made<Direct>}};
}

}  // namespace palpate::lab
