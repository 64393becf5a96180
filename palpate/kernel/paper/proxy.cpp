// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/paper/proxy.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/kernel/core/lanes.hpp"
#include "palpate/kernel/core/vectorise.hpp"

// Compiled as patch_loops.cpp is, so that (1) becomes vector code in the middle of the movement: a
// step waits for the step before, and that wait is most of its cost.

namespace palpate {
namespace {

// In free motion the proxy is at the HIP when it is nearer than this [m]: far below what any sensor
// resolves, and above the rounding of a step that was meant to end there.
constexpr double at_hip = 1e-9;

// A sum of unit vectors shorter than this has no direction worth following.
constexpr double no_direction = 1e-6;

// A step shorter than this [m] is none: the proxy is blocked where it is.
constexpr double no_step = 1e-12;

constexpr double square(double x) { return x * x; }

// Is x finite? A test of its bits, as this file is compiled with -ffinite-math-only and a cloud may
// hold points that are NaN.
constexpr bool is_number(double x) {
  constexpr std::uint64_t exponent = 0x7ff0'0000'0000'0000U;
  return (std::bit_cast<std::uint64_t>(x) & exponent) != exponent;
}

struct DirectionSums {
  Float3 direction;       // n' of (1)
  float nearest_squared;  // [m^2] to the nearest point
};

// Eq. (1) with the weights of (2): `inverse_width` is 1 / (r_3 - r_1), `reach` r_3 of these.
PALPATE_INLINED DirectionSums sum_directions(const PointArrays& points, Float3 at, float reach,
                                             float inverse_width) noexcept {
  FloatLanes sum_x{};
  FloatLanes sum_y{};
  FloatLanes sum_z{};
  FloatLanes nearest;
  nearest.fill(std::numeric_limits<float>::max());
  const std::size_t end = whole_blocks(points.size);
  for (std::size_t block = 0; block < end; block += sum_lanes) {
#pragma omp simd
    for (std::size_t lane = 0; lane < sum_lanes; ++lane) {
      const float dx = at.x - points.x[block + lane];
      const float dy = at.y - points.y[block + lane];
      const float dz = at.z - points.z[block + lane];
      constexpr float smallest = 1e-18F;  // a nanometre, squared: keeps 1 / r finite
      const float squared = dx * dx + (dy * dy + (dz * dz + smallest));
      const float r = std::sqrt(squared);
      // Eq. (2) with s = (r_3 - r) / (r_3 - r_1) kept in 0..1, hence 1 within r_1 and 0 beyond r_3.
      float s = reach - r * inverse_width;
      s = s < 0.0F ? 0.0F : s;
      s = s > 1.0F ? 1.0F : s;
      const float s_2 = s * s;
      const float psi = s_2 * s_2 * (5.0F - 4.0F * s);
      const float scale = psi / r;
      sum_x[lane] += dx * scale;  // Eq. (1)
      sum_y[lane] += dy * scale;
      sum_z[lane] += dz * scale;
      nearest[lane] = squared < nearest[lane] ? squared : nearest[lane];
    }
  }
  return {{sum_of_lanes(sum_x), sum_of_lanes(sum_y), sum_of_lanes(sum_z)}, least_of_lanes(nearest)};
}

// The steps whose size takes another search of the patch: out of entrenchment, and to the HIP.
Vec3 searched_step(const Patch& patch, const Vec3& at, ContactState state, const Vec3& normal,
                   const Vec3& u, const ProxyParameters& proxy) noexcept {
  // What the patch does not cover is not seen.
  const double reach = patch.ball().radius - (at - patch.ball().centre).norm() - proxy.r_c();
  if (state == ContactState::entrenchment) {
    const double length = normal.norm();
    if (!(length > 0.0)) return Vec3::Zero();
    const Vec3 n = normal / length;
    const double d = escape_travel(patch, at, n, proxy);  // Eq. (10)
    return std::min(d, reach) * n;                        // Eq. (5)
  }
  const double distance = u.norm();
  if (distance <= at_hip) return Vec3::Zero();
  const Vec3 direction = u / distance;
  const double clear = clear_travel(patch, at, direction, proxy.r_c());  // Eq. (9)
  return std::min({clear, distance, reach}) * direction;                 // Eq. (4), (7)
}

Vec3 fixed_proxy_step(ContactState state, const Vec3& normal, const Vec3& u,
                      const ProxyParameters& proxy) noexcept {
  const double d = 0.1 * proxy.r_1;
  if (state == ContactState::entrenchment) return d * normal.normalized();
  Vec3 along = u;
  if (state == ContactState::contact && u.dot(normal) < 0.0)
    along -= u.dot(normal) / normal.squaredNorm() * normal;
  const double length = along.norm();
  return length <= d ? along : Vec3(d / length * along);
}

PALPATE_VECTORISED
MovementEnd move(const Patch& patch, const Vec3& hip, const ProxyParameters& parameters,
                 double cos_theta, bool fixed_step, ProxyMovement& movement) {
  const ProxyParameters proxy = parameters;
  const PointArrays points = patch.points();
  const auto reach = static_cast<float>(proxy.r_3 / (proxy.r_3 - proxy.r_1));
  const auto inverse_width = static_cast<float>(1.0 / (proxy.r_3 - proxy.r_1));
  const double cos_theta_squared = cos_theta * cos_theta;
  ProxyMovement now = movement;
  MovementEnd end = MovementEnd::patch_left;
  while (patch.covers(now.at, proxy.r_3)) {
    if (!now.looked) {  // Step 2: normal and state
      const DirectionSums sums = sum_directions(points, patch.relative(now.at), reach,
                                                inverse_width);  // Eq. (1), (2)
      const double nearest = sums.nearest_squared;
      now.state = nearest < square(proxy.r_1)    ? ContactState::entrenchment
                  : nearest <= square(proxy.r_2) ? ContactState::contact
                                                 : ContactState::free_motion;
      now.normal = Vec3(sums.direction.x, sums.direction.y, sums.direction.z);
      now.looked = true;
    }
    double squared_length = now.normal.squaredNorm();  // of n'; n = n' / |n'| is not needed as such
    const bool known = is_number(squared_length) && squared_length > square(no_direction);
    if (!known) now.normal.setZero();
    if (now.state != ContactState::free_motion) {
      now.touched = true;
      if (known) {
        now.contact_normal = now.normal;
      } else {
        now.normal_undefined = true;
      }
    }
    const Vec3& normal = known ? now.normal : now.contact_normal;
    if (!known) squared_length = normal.squaredNorm();

    // Step 7.
    const Vec3 u = hip - now.at;
    const double inside = -u.dot(normal);  // |n'| times how far the HIP is inside
    const double squared_distance = u.squaredNorm();
    const bool at_the_hip = squared_distance <= square(at_hip);
    const bool aligned = known && inside > 0.0 &&
                         inside * inside > cos_theta_squared * squared_distance * squared_length;
    if (at_the_hip ? now.state != ContactState::entrenchment
                   : now.state == ContactState::contact && aligned) {  // Eq. (8)
      end = MovementEnd::at_rest;
      break;
    }
    if (now.steps == proxy.step_budget) {
      end = MovementEnd::budget_spent;
      break;
    }

    // Steps 3 to 6.
    const auto slide = [&] {
      const Vec3 u_p = u + inside / squared_length * normal;  // u - (u . n) n
      const double squared = u_p.squaredNorm();
      const double scale = squared <= square(at_hip) ? 0.0
                           : squared < square(proxy.r_1)
                               ? gamma_schedule(proxy.gamma, now.contact_steps)  // Eq. (11)
                               : proxy.xi * proxy.r_1 / std::sqrt(squared);      // Eq. (12)
      return Vec3(scale * u_p);                                                  // Eq. (6)
    };
    Vec3 step;
    if (fixed_step) {
      step = fixed_proxy_step(now.state, normal, u, proxy);
    } else if (now.state == ContactState::contact && inside > 0.0) {
      step = slide();
    } else {
      step = searched_step(patch, now.at, now.state, normal, u, proxy);
      // The HIP is outside of n, but a point that stands out of the noise is in the way: the proxy
      // goes round it. docs/method.md, "Blocked in contact".
      if (now.state == ContactState::contact && known && step.squaredNorm() <= square(no_step))
        step = slide();
    }
    const double squared_step = step.squaredNorm();
    if (squared_step <= square(no_step) || !is_number(squared_step)) {
      end = MovementEnd::at_rest;
      break;
    }
    if (now.state == ContactState::contact) ++now.contact_steps;
    if (now.steps == 0) now.first_step = step;
    now.at += step;
    now.looked = false;
    ++now.steps;
  }
  movement = now;
  return end;
}

}  // namespace

double gamma_schedule(double gamma, int contact_steps) noexcept {
  constexpr int constant_for = 8;
  return contact_steps < constant_for ? gamma : gamma * constant_for / contact_steps;
}

MovementEnd move_proxy(const Patch& patch, const Vec3& hip, const ProxyParameters& proxy,
                       double cos_theta, bool fixed_step, ProxyMovement& movement) noexcept {
  return vectorised<move>(patch, hip, proxy, cos_theta, fixed_step, movement);
}

}  // namespace palpate
