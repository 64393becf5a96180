// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/proxy.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

// In free motion the proxy is at the HIP when it is nearer than this [m]: far below what any sensor
// resolves, and above the rounding of a step that was meant to end there.
constexpr double at_hip = 1e-9;

// A sum of unit vectors shorter than this has no direction worth following.
constexpr double no_direction = 1e-6;

}  // namespace

const char* to_string(ContactState state) noexcept {
  switch (state) {
    case ContactState::free_motion:
      return "free";
    case ContactState::contact:
      return "contact";
    case ContactState::entrenchment:
      return "entrenchment";
  }
  return "unknown";
}

Surroundings look_around(const Patch& patch, const Vec3& at,
                         const ProxyParameters& proxy) noexcept {
  const ContactSums sums = contact_sums(patch, at, proxy);
  Surroundings around{ContactState::free_motion, std::nullopt};
  if (sums.nearest_distance < proxy.r_1) {
    around.state = ContactState::entrenchment;
  } else if (sums.nearest_distance <= proxy.r_2) {
    around.state = ContactState::contact;
  }
  const double length = sums.direction.norm();
  if (length > no_direction) around.normal = sums.direction / length;
  return around;
}

bool has_converged(const Surroundings& around, const Vec3& u, double cos_theta) noexcept {
  const double distance = u.norm();
  if (distance <= at_hip) return around.state != ContactState::entrenchment;
  if (around.state != ContactState::contact || !around.normal) return false;
  return -u.dot(*around.normal) > cos_theta * distance;  // Eq. (8)
}

double gamma_schedule(double gamma, int contact_steps) noexcept {
  constexpr int constant_for = 8;
  return contact_steps < constant_for ? gamma : gamma * constant_for / contact_steps;
}

Vec3 proxy_step(const Patch& patch, const Vec3& at, const Surroundings& around, const Vec3& normal,
                const Vec3& u, double reach, int contact_steps,
                const ProxyParameters& proxy) noexcept {
  if (around.state == ContactState::entrenchment) {
    const double d = escape_travel(patch, at, normal, proxy);  // Eq. (10)
    return std::min(d, reach) * normal;                        // Eq. (5)
  }
  const double distance = u.norm();
  if (distance <= at_hip) return Vec3::Zero();
  const bool hip_inside = u.dot(normal) < 0.0;
  if (around.state == ContactState::contact && hip_inside) {
    const Vec3 u_p = u - u.dot(normal) * normal;
    const double length = u_p.norm();
    if (length <= at_hip) return Vec3::Zero();
    const double d = length < proxy.r_1
                         ? gamma_schedule(proxy.gamma, contact_steps) * length  // Eq. (11)
                         : proxy.xi * proxy.r_1;                                // Eq. (12)
    return d / length * u_p;                                                    // Eq. (6)
  }
  const Vec3 direction = u / distance;
  const double clear = clear_travel(patch, at, direction, proxy.r_c());  // Eq. (9)
  return std::min({clear, distance, reach}) * direction;                 // Eq. (4), (7)
}

Vec3 fixed_proxy_step(const Surroundings& around, const Vec3& normal, const Vec3& u,
                      const ProxyParameters& proxy) noexcept {
  const double d = 0.1 * proxy.r_1;
  if (around.state == ContactState::entrenchment) return d * normal;
  Vec3 along = u;
  if (around.state == ContactState::contact && u.dot(normal) < 0.0) along -= u.dot(normal) * normal;
  const double length = along.norm();
  return length <= d ? along : Vec3(d / length * along);
}

}  // namespace palpate
