// SPDX-License-Identifier: Apache-2.0
#include "lab/implicit_proxy.hpp"

#include <algorithm>
#include <cmath>

namespace palpate::lab {
namespace {

constexpr int most_steps = 64;
constexpr int most_strides = 512;
constexpr double at_rest = 1e-7;  // [m]

bool inside(const Field& field, const Vec3& at) {
  const auto here = field(at);
  return here && here->value < 0.0;
}

}  // namespace

void ImplicitProxy::seat(const Vec3& point) {
  point_ = point;
  touching_ = false;
}

// The surface between two places, from its outer side.
Vec3 ImplicitProxy::between(const Field& field, Vec3 outside, Vec3 inside_) {
  for (int i = 0; i < 16; ++i) {
    const Vec3 middle = 0.5 * (outside + inside_);
    (inside(field, middle) ? inside_ : outside) = middle;
  }
  return outside;
}

void ImplicitProxy::climb(const Field& field) {
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
    if (!inside(field, next)) {
      point_ = between(field, next, last);
      touching_ = true;
      return;
    }
    last = next;
  }
}

// To the HIP, or to where the way enters the surface. True in the latter case.
bool ImplicitProxy::approach(const Field& field, const Vec3& hip) {
  const Vec3 way = hip - *point_;
  const int strides =
      std::clamp(static_cast<int>(std::ceil(way.norm() / stride_)), 1, most_strides);
  Vec3 last = *point_;
  for (int i = 1; i <= strides; ++i) {
    const Vec3 next = *point_ + way * (double(i) / strides);
    if (inside(field, next)) {
      point_ = between(field, last, next);
      touching_ = true;
      return true;
    }
    last = next;
  }
  point_ = hip;
  return false;
}

// One step in the tangent plane and back to the surface. False if it rests.
bool ImplicitProxy::slide(const Field& field, const Vec3& hip, const Vec3& normal) {
  const Vec3 way = hip - *point_;
  const Vec3 along = way - way.dot(normal) * normal;
  const double length = along.norm();
  if (length < at_rest) return false;
  const Vec3 aside = *point_ + along * std::min(1.0, stride_ / length);
  const bool rising = inside(field, aside);
  // Up until it is out, or down until it is in.
  const Vec3 step = (rising ? 0.25 : -0.25) * stride_ * normal;
  Vec3 last = aside;
  for (int i = 1; i <= 8; ++i) {
    const Vec3 next = aside + i * step;
    if (inside(field, next) != rising) {
      const Vec3 found = rising ? between(field, next, last) : between(field, last, next);
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

std::optional<Contact> ImplicitProxy::follow(const Field& field, const Vec3& hip) {
  if (!point_) point_ = hip;
  if (changed_) climb(field);
  for (steps_ = 0; steps_ < most_steps; ++steps_) {
    if (!touching_ && !approach(field, hip)) return std::nullopt;
    const auto here = field(*point_);
    if (!here || !(here->gradient.norm() > 1e-12)) {
      touching_ = false;  // the surface is gone from here
      if (!approach(field, hip)) return std::nullopt;
      continue;
    }
    const Vec3 normal = here->gradient.normalized();
    const Vec3 way = hip - *point_;
    if (way.dot(normal) >= 0.0) {
      touching_ = false;
      if (!approach(field, hip)) return std::nullopt;
      continue;
    }
    if (!slide(field, hip, normal)) return Contact{*point_, normal};
  }
  const auto here = field(*point_);
  if (!touching_ || !here || !(here->gradient.norm() > 1e-12)) return std::nullopt;
  return Contact{*point_, here->gradient.normalized()};
}

void ImplicitMethod::frame(const Cloud& cloud, double /*stamp*/) noexcept {
  take(cloud, proxy_.point_or(Vec3::Zero()));
  proxy_.surface_changed();
}

Tick ImplicitMethod::tick(const Vec3& hip, double t) noexcept {
  if (seen() == nullptr) return free(hip, t);
  prepare(proxy_.point_or(hip));
  const auto contact = proxy_.follow([this](const Vec3& at) { return field(at); }, hip);
  Tick tick = contact ? held(hip, *contact, t) : free(hip, t);
  tick.steps = proxy_.steps();
  return tick;
}

}  // namespace palpate::lab
