// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/feel/friction.hpp"

#include <algorithm>
#include <numbers>

#include "palpate/kernel/core/mathematics.hpp"

namespace palpate {
namespace {

// [-] of the deflection of steady sliding: below it the bristle only bends.
constexpr double elastic = 0.97;
// [s] over which a large normal force is forgotten: three frames at 30 Hz, the noise of each of
// which is another.
constexpr double memory = 0.1;
// [N] A contact is over once less than this is left of its normal force.
constexpr double least_push = 1e-3;

// How much of a movement goes into sliding: none while the bristle bends back or little, all where
// it is bent as in steady sliding.
double sliding_share(double bend, bool back) {
  if (back || bend <= elastic) return 0.0;
  if (bend >= 1.0) return 1.0;
  const double x = (bend - elastic) / (1.0 - elastic);
  return 0.5 - 0.5 * math::cos(std::numbers::pi * x);
}

}  // namespace

double friction_coefficient(const FrictionParameters& p, double speed) noexcept {
  const double faster = speed / p.stribeck_speed;
  return p.friction * (p.kinetic_share + (1.0 - p.kinetic_share) * math::exp(-faster * faster));
}

void Friction::reset() noexcept {
  bristle_ = normal_ = Vec3::Zero();
  pressed_ = sliding_ = 0.0;
}

// Hazard: material-energy
Vec3 Friction::update(const Vec3& push, const Vec3& moved, const Vec3& velocity,
                      double dt) noexcept {
  const double normal_force = push.norm();
  const FrictionParameters& p = parameters_;
  pressed_ = std::max(normal_force, pressed_ * math::exp(-std::max(dt, 0.0) / memory));
  if (!(pressed_ > least_push)) {
    reset();
    return Vec3::Zero();
  }
  if (normal_force > 0.0) normal_ = push / normal_force;
  const auto tangential = [this](const Vec3& v) -> Vec3 { return v - v.dot(normal_) * normal_; };

  // On a curved surface the bristle turns with the tangential plane.
  const double length = bristle_.norm();
  bristle_ = tangential(bristle_);
  if (const double kept = bristle_.norm(); kept > 0.5 * length) bristle_ *= length / kept;

  const Vec3 step = tangential(moved);
  const Vec3 slide = tangential(velocity);
  const double speed = slide.norm();
  Vec3 force = Vec3::Zero();
  if (p.friction > 0.0) {
    // By the anchor's speed: the hand's would let a hand that sticks and trembles slip.
    const double coefficient = friction_coefficient(p, sliding_ * speed);
    const double steady = coefficient * pressed_ / p.bristle_stiffness;  // [m]
    const double bend = bristle_.norm() / steady;
    sliding_ = sliding_share(bend, bristle_.dot(step) < 0.0);
    bristle_ += step - sliding_ * step.norm() / steady * bristle_;
    // In a step longer than the bristle, or once the push is less, the anchor is dragged along.
    const double longest = p.friction * pressed_ / p.bristle_stiffness;
    if (const double now = bristle_.norm(); now > longest) bristle_ *= longest / now;
    const Vec3 rate = slide - sliding_ * speed / steady * bristle_;  // [m/s] at which it bends
    force = -normal_force / pressed_ * (p.bristle_stiffness * bristle_ + p.bristle_damping * rate);
    const double most = p.friction * normal_force;
    if (const double size = force.norm(); size > most) force *= most / size;
  }
  return force - p.viscosity * normal_force * slide;
}

}  // namespace palpate
