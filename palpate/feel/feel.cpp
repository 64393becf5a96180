// SPDX-License-Identifier: Apache-2.0
#include "palpate/feel/feel.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {

Feel::Feel(std::unique_ptr<Method> method, const Parameters& parameters)
    : method_(std::move(method)) {
  take(parameters);
}

void Feel::take(const Parameters& parameters) noexcept {
  const FrictionParameters& friction = parameters.friction;
  friction_.set(friction);
  rough_ = friction.friction > 0.0 || friction.viscosity > 0.0;
  max_force_ = parameters.coupling.max_force;
  if (!rough_) {
    friction_.reset();
    hand_.reset();
  }
}

void Feel::set_parameters(const Parameters& parameters) {
  method_->set_parameters(parameters);
  take(parameters);
}

void Feel::seat(const Vec3& proxy) noexcept {
  method_->seat(proxy);
  friction_.reset();
  hand_.reset();
}

void Feel::frame(const Cloud& cloud, double stamp) noexcept {
  method_->frame(cloud, stamp);
}

Tick Feel::tick(const Vec3& hip, double t) noexcept {
  Tick tick = method_->tick(hip, t);
  if (!rough_ || (tick.flags & non_finite_input) != 0) return tick;
  // A surface moves along its normal as far as depth shows, so what the hand moves in the
  // tangential plane is relative to it.
  const bool first = !hand_.started();
  const Vec3 moved = first ? Vec3(Vec3::Zero()) : Vec3(hip - last_hip_);
  const double dt = first ? 0.0 : t - hand_.t();
  hand_.update(hip, t);
  last_hip_ = hip;
  if ((tick.flags & (free_space_released | proxy_let_go)) != 0) friction_.reset();
  const Vec3 drag = friction_.update(tick.force, moved, hand_.value(), dt);
  // Together no more than the limit: the normal force comes first.
  const double room = std::max(max_force_ * max_force_ - tick.force.squaredNorm(), 0.0);
  const double size = drag.squaredNorm();
  if (size > room) tick.flags |= force_saturated;
  tick.force += size > room ? Vec3(std::sqrt(room / size) * drag) : drag;
  if (const double length = tick.force.norm(); length > max_force_)
    tick.force *= (1.0 - 1e-15) * max_force_ / length;  // after rounding, too
  return tick;
}

}  // namespace palpate
