// SPDX-License-Identifier: Apache-2.0
#include "lab/implicit_method.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::lab {
namespace {

constexpr int most_steps = 64;
constexpr int most_strides = 512;
constexpr double at_rest = 1e-7;  // [m]

}  // namespace

bool ImplicitMethod::inside(const Vec3& at) {
  const auto here = field(at);
  return here && here->value < 0.0;
}

std::optional<Vec3> ImplicitMethod::normal_at(const Vec3& at) {
  const auto here = field(at);
  if (!here || !(here->gradient.norm() > 1e-12)) return std::nullopt;
  return here->gradient.normalized();
}

// The surface between two places, from its outer side.
Vec3 ImplicitMethod::between(Vec3 outer, Vec3 inner) {
  for (int i = 0; i < 16; ++i) {
    const Vec3 middle = 0.5 * (outer + inner);
    (inside(middle) ? inner : outer) = middle;
  }
  return outer;
}

void ImplicitMethod::climb() {
  changed_ = false;
  const auto here = field(*point_);
  if (!here || here->value >= 0.0 || !(here->gradient.norm() > 1e-12)) {
    touching_ = false;  // it may have sunk: approached again
    return;
  }
  const Vec3 out = here->gradient.normalized();
  Vec3 last = *point_;
  for (double gone = stride_; gone <= reach_; gone += stride_) {
    const Vec3 next = *point_ + gone * out;
    if (!inside(next)) {
      point_ = between(next, last);
      touching_ = true;
      return;
    }
    last = next;
  }
}

// To the HIP, or to where the way enters the surface. True in the latter case.
bool ImplicitMethod::approach(const Vec3& hip) {
  const Vec3 way = hip - *point_;
  const int strides =
      std::clamp(static_cast<int>(std::ceil(way.norm() / stride_)), 1, most_strides);
  Vec3 last = *point_;
  for (int i = 1; i <= strides; ++i) {
    const Vec3 next = *point_ + way * (double(i) / strides);
    if (inside(next)) {
      point_ = between(last, next);
      touching_ = true;
      return true;
    }
    last = next;
  }
  point_ = hip;
  return false;
}

// One step in the tangent plane and back to the surface. False if it rests.
bool ImplicitMethod::slide(const Vec3& hip, const Vec3& normal) {
  const Vec3 way = hip - *point_;
  const Vec3 along = way - way.dot(normal) * normal;
  const double length = along.norm();
  if (length < at_rest) return false;
  const Vec3 aside = *point_ + along * std::min(1.0, stride_ / length);
  const bool rising = inside(aside);
  // Up until it is out, or down until it is in.
  const Vec3 step = (rising ? 0.25 : -0.25) * stride_ * normal;
  Vec3 last = aside;
  for (int i = 1; i <= 8; ++i) {
    const Vec3 next = aside + i * step;
    if (inside(next) != rising) {
      const Vec3 found = rising ? between(next, last) : between(last, next);
      // Only nearer to the HIP, or it would go back and forth without end.
      if ((hip - found).norm() > way.norm() - at_rest) return false;
      point_ = found;
      return true;
    }
    last = next;
  }
  if (rising) return false;  // too steep: blocked
  point_ = aside;            // over an edge
  touching_ = false;
  return true;
}

// The contact, or none in free motion.
std::optional<Contact> ImplicitMethod::follow(const Vec3& hip) {
  if (!point_) point_ = hip;
  if (changed_) climb();
  for (steps_ = 0; steps_ < most_steps; ++steps_) {
    if (!touching_ && !approach(hip)) return std::nullopt;
    const std::optional<Vec3> normal = normal_at(*point_);
    // The surface is gone from here, or the HIP is outside.
    if (!normal || (hip - *point_).dot(*normal) >= 0.0) {
      touching_ = false;
      if (!approach(hip)) return std::nullopt;
    } else if (!slide(hip, *normal)) {
      return Contact{*point_, *normal};
    }
  }
  const std::optional<Vec3> normal = normal_at(*point_);
  if (!touching_ || !normal) return std::nullopt;
  return Contact{*point_, *normal};
}

void ImplicitMethod::seat(const Vec3& proxy) noexcept {
  point_ = proxy;
  touching_ = false;
}

void ImplicitMethod::frame(const Cloud& cloud, double /*stamp*/) noexcept {
  take(cloud, point_.value_or(Vec3::Zero()));
  changed_ = true;
}

Tick ImplicitMethod::tick(const Vec3& hip, double t) noexcept {
  if (seen() == nullptr) return free(hip, t);
  prepare(point_.value_or(hip));
  const auto contact = follow(hip);
  Tick tick = contact ? held(hip, *contact, t) : free(hip, t);
  tick.steps = steps_;
  return tick;
}

}  // namespace palpate::lab
