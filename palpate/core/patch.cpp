// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/patch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/vectorise.hpp"

// The reductions below are the inner loops of the method: plain loops that the compiler turns into
// vector code.

namespace palpate {
namespace {

struct Float3 {
  float x, y, z;
};

Float3 relative(const Vec3& at, const Patch& patch) {
  const Vec3 p = at - patch.ball().centre;
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

Float3 narrow(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

struct Sums {
  float x, y, z, nearest_squared;
};

PALPATE_VECTORISED
Sums sum_directions(const float* x, const float* y, const float* z, std::size_t size, float px,
                    float py, float pz, float r_1, float inverse_width) {
  float sum_x = 0.0F;
  float sum_y = 0.0F;
  float sum_z = 0.0F;
  float nearest = std::numeric_limits<float>::max();
#pragma omp simd reduction(+ : sum_x, sum_y, sum_z) reduction(min : nearest)
  for (std::size_t i = 0; i < size; ++i) {
    const float dx = px - x[i];
    const float dy = py - y[i];
    const float dz = pz - z[i];
    const float squared = dx * dx + dy * dy + dz * dz;
    const float r = std::sqrt(squared);
    // Eq. (2), with t = (r - r_1) / (r_3 - r_1) kept in 0..1: 1 within r_1, 0 beyond r_3.
    float t = (r - r_1) * inverse_width;
    t = t < 0.0F ? 0.0F : t;
    t = t > 1.0F ? 1.0F : t;
    const float s = 1.0F - t;
    const float psi = s * s * s * s * (4.0F * t + 1.0F);
    const float scale = psi / (r > 1e-9F ? r : 1e-9F);
    sum_x += dx * scale;  // Eq. (1)
    sum_y += dy * scale;
    sum_z += dz * scale;
    nearest = squared < nearest ? squared : nearest;
  }
  return {sum_x, sum_y, sum_z, nearest};
}

PALPATE_VECTORISED
float smallest_travel(const float* x, const float* y, const float* z, std::size_t size, float px,
                      float py, float pz, float dir_x, float dir_y, float dir_z, float squared_r_c,
                      float unlimited) {
  float travel = unlimited;
#pragma omp simd reduction(min : travel)
  for (std::size_t i = 0; i < size; ++i) {
    const float wx = x[i] - px;
    const float wy = y[i] - py;
    const float wz = z[i] - pz;
    const float along = wx * dir_x + wy * dir_y + wz * dir_z;
    // Eq. (9): |w - d dir| = r_c has the roots along -+ sqrt(under); their product is `outside`, so
    // the smaller one is outside / (along + sqrt(under)), which does not cancel.
    const float outside = wx * wx + wy * wy + wz * wz - squared_r_c;
    const float under = along * along - outside;
    const float root = std::sqrt(under > 0.0F ? under : 0.0F);
    const float positive = along > 1e-9F ? along : 1e-9F;
    float d = outside / (positive + root);
    d = d > 0.0F ? d : 0.0F;
    const bool ahead = along > 0.0F;
    const bool meets = under >= 0.0F;
    d = (ahead & meets) ? d : unlimited;
    travel = d < travel ? d : travel;
  }
  return travel;
}

PALPATE_VECTORISED
float largest_escape(const float* x, const float* y, const float* z, std::size_t size, float px,
                     float py, float pz, float dir_x, float dir_y, float dir_z, float squared_r_1,
                     float squared_r_c) {
  float escape = 0.0F;
#pragma omp simd reduction(max : escape)
  for (std::size_t i = 0; i < size; ++i) {
    const float wx = x[i] - px;
    const float wy = y[i] - py;
    const float wz = z[i] - pz;
    const float along = wx * dir_x + wy * dir_y + wz * dir_z;
    const float squared = wx * wx + wy * wy + wz * wz;
    const float under = along * along + squared_r_c - squared;
    // Eq. (10): the positive root; `under` is positive wherever the point is entrenched.
    const float d = along + std::sqrt(under > 0.0F ? under : 0.0F);
    const float entrenched = squared < squared_r_1 ? d : 0.0F;
    escape = entrenched > escape ? entrenched : escape;
  }
  return escape;
}

}  // namespace

Patch::Patch()
    : x_(std::make_unique<float[]>(capacity)),
      y_(std::make_unique<float[]>(capacity)),
      z_(std::make_unique<float[]>(capacity)) {}

double wendland_weight(double r, const ProxyParameters& proxy) {
  const double t = std::clamp((r - proxy.r_1) / (proxy.r_3 - proxy.r_1), 0.0, 1.0);
  return std::pow(1.0 - t, 4) * (4.0 * t + 1.0);  // Eq. (2)
}

ContactSums contact_sums(const Patch& patch, const Vec3& at,
                         const ProxyParameters& proxy) noexcept {
  const Float3 p = relative(at, patch);
  const Sums sums = sum_directions(patch.x(), patch.y(), patch.z(), patch.size(), p.x, p.y, p.z,
                                   static_cast<float>(proxy.r_1),
                                   static_cast<float>(1.0 / (proxy.r_3 - proxy.r_1)));
  return {Vec3(sums.x, sums.y, sums.z), patch.size() == 0
                                            ? std::numeric_limits<double>::infinity()
                                            : std::sqrt(double{sums.nearest_squared})};
}

double clear_travel(const Patch& patch, const Vec3& at, const Vec3& direction,
                    double r_c) noexcept {
  const Float3 p = relative(at, patch);
  const Float3 dir = narrow(direction);
  constexpr float unlimited = std::numeric_limits<float>::max();
  const float travel =
      smallest_travel(patch.x(), patch.y(), patch.z(), patch.size(), p.x, p.y, p.z, dir.x, dir.y,
                      dir.z, static_cast<float>(r_c * r_c), unlimited);
  return travel == unlimited ? std::numeric_limits<double>::infinity() : double{travel};
}

double escape_travel(const Patch& patch, const Vec3& at, const Vec3& direction,
                     const ProxyParameters& proxy) noexcept {
  const Float3 p = relative(at, patch);
  const Float3 dir = narrow(direction);
  return largest_escape(patch.x(), patch.y(), patch.z(), patch.size(), p.x, p.y, p.z, dir.x, dir.y,
                        dir.z, static_cast<float>(proxy.r_1 * proxy.r_1),
                        static_cast<float>(proxy.r_c() * proxy.r_c()));
}

}  // namespace palpate
