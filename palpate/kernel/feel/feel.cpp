// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/feel/feel.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {
namespace {

// [m] that the foot moves before it is looked up again what is there: 1/30 of what is averaged.
constexpr double same_place = 1e-4;
// [s] over which an impact's speed is averaged: an encoder's counts of 0.055 mm at 1 kHz are then
// some 5 mm/s.
constexpr double impact_time = 6e-3;
// [-] A cushion takes away no more than all of the force, and adds no more than as much again.
constexpr double hardest_cushion = 2.0;
// [-] of the normal force that a grain's vibration is at most.
constexpr double roughest = 0.5;
// [-] slope of a relief, 27 degrees: steeper, a hand would be stuck in it.
constexpr double steepest = 0.5;

bool has_feel(const Material& m, double stiffness) {
  return m.friction > 0.0 || m.viscosity > 0.0 || m.cushion > 0.0 || m.tap.tap > 0.0 ||
         m.texture.grain > 0.0 || m.texture.relief != 0.0 || m.stiffness < stiffness;
}

}  // namespace

Feel::Feel(std::unique_ptr<Method> method, const Parameters& parameters)
    : method_(std::move(method)) {
  take(parameters);
}

void Feel::take(const Parameters& parameters) noexcept {
  bristles_ = parameters.friction;
  scene_ = material_of(parameters);
  max_force_ = parameters.coupling.max_force;
  stiffness_ = parameters.coupling.stiffness;
  contact_radius_ = parameters.proxy.r_c();
  looked_ = false;
  look_whether_to_feel();
}

void Feel::look_whether_to_feel() noexcept {
  feels_ = has_feel(scene_, stiffness_) || clouds_.has_materials();
  if (feels_) return;
  forget_contact();
  hand_.reset();
}

void Feel::forget_contact() noexcept {
  looked_ = false;
  hardness_.reset();
  friction_.reset();
  grain_.reset();
  drag_ = Vec3::Zero();
}

void Feel::set_parameters(const Parameters& parameters) noexcept {
  method_->set_parameters(parameters);
  take(parameters);
}

void Feel::seat(const Vec3& proxy) noexcept {
  method_->seat(proxy);
  forget_contact();
  tap_.reset();
  hand_.reset();
}

void Feel::observe(const Observation& seen) noexcept {
  method_->observe(seen);
  clouds_.take(seen.camera, seen.cloud);
  looked_ = false;
  look_whether_to_feel();
}

// Depth shows no motion of a surface but that along its normal.
Feel::Movement Feel::move(const Tick& tick) noexcept {
  Movement movement;
  if (hand_.started()) {
    movement.dt = tick.t - hand_.t();
    movement.by = tick.hip - last_hip_ - movement.dt * tick.surface_motion;
  }
  hand_.update(tick.hip, tick.t);
  last_hip_ = tick.hip;
  movement.velocity = hand_.value() - tick.surface_motion;
  const double share = movement.dt > 0.0 ? movement.dt / (movement.dt + impact_time) : 1.0;
  approach_ += share * (movement.velocity - approach_);
  return movement;
}

void Feel::look_at_surface(const Tick& tick) noexcept {
  const Vec3 foot = tick.proxy - contact_radius_ * tick.normal;
  if (looked_ && (foot - looked_at_).squaredNorm() < same_place * same_place) return;
  looked_ = true;
  looked_at_ = foot;
  here_ = scene_;
  slope_ = Vec3::Zero();
  if (clouds_.parts().empty() || tick.normal.isZero() ||
      !(clouds_.has_materials() || scene_.texture.relief != 0.0))
    return;
  SurfaceSample sample;
  clouds_.sample(foot, tick.normal, averaged, sample);
  here_ = blend(sample, scene_, stiffness_);
  if (sample.has_slope) slope_ = sample.slope;
}

// The normal force on a slope of the relief, and the vibration of the grains.
Feel::Texture Feel::texture(const Vec3& push, const Movement& movement) noexcept {
  const double size = push.norm();
  const TextureParameters& texture = here_.texture;
  if (!(size > 0.0)) {
    grain_.reset();
    return {};
  }
  const Vec3 normal = push / size;
  Texture felt;
  if (texture.relief != 0.0) {
    Vec3 rise = texture.relief * (slope_ - slope_.dot(normal) * normal);
    if (const double steep = rise.norm(); steep > steepest) rise *= steepest / steep;
    felt.force -= size * rise;
  }
  if (texture.grain > 0.0) {
    const Vec3 slide = movement.velocity - movement.velocity.dot(normal) * normal;
    const double grain =
        texture.grain * grain_.update(texture.grain_length, slide.norm(), movement.dt);
    felt.vibration = std::clamp(grain, -roughest, roughest) * push;
    felt.force += felt.vibration;
  } else {
    grain_.reset();
  }
  return felt;
}

Tick Feel::tick(const Vec3& hip, double t) noexcept {
  return tick(HandPose{.position = hip}, t);
}

// Hazard: material-force
Tick Feel::tick(const HandPose& hand, double t) noexcept {
  Tick tick = method_->tick(hand, t);
  if (!feels_ || (tick.flags & non_finite_input) != 0) return tick;
  const Movement movement = move(tick);
  if ((tick.flags & (free_space_released | proxy_let_go)) != 0) forget_contact();

  const double pressed = tick.force.norm();
  if (pressed > 0.0) look_at_surface(tick);
  const bool has_direction = pressed > undirected_force || (pressed > 0.0 && tick.normal.isZero());
  const Vec3 normal = has_direction ? Vec3(tick.force / pressed) : tick.normal;
  // As hard as the material: its spring, and its cushion.
  const double wanted = std::min(here_.stiffness / std::max(stiffness_, 1e-9), 1.0);
  const Hardness::Felt felt = hardness_.update(
      wanted, tick.force, stiffness_, -drag_.dot(movement.by), movement.by, movement.velocity);
  tick.hardness = felt.share;
  const double cushion =
      std::clamp(1.0 - here_.cushion * movement.velocity.dot(normal), 0.0, hardest_cushion);
  const Vec3 push = felt.share * cushion * tick.force;

  bristles_.friction = here_.friction;
  bristles_.kinetic_share = here_.kinetic_share;
  bristles_.viscosity = here_.viscosity;
  friction_.set(bristles_);
  drag_ = friction_.update(push, movement.by, movement.velocity, movement.dt);
  const Texture rough = texture(push, movement);
  const Vec3 beside = drag_ + felt.brake + rough.force;
  const Vec3 ringing = tap_.update(pressed, normal, -approach_.dot(normal), here_.tap, t);

  // Together no more than the limit: the normal force comes first, the ringing last.
  const auto add = [&](const Vec3& more) {
    const double room = max_force_ * max_force_ - tick.force.squaredNorm();
    const double along = tick.force.dot(more);
    const double size = more.squaredNorm();
    // The largest share s of `more` with |force + s more| <= max_force.
    if (!(size > 0.0)) return 0.0;
    const double share =
        room > 0.0 ? (-along + std::sqrt(along * along + size * room)) / size : 0.0;
    if (share < 1.0) tick.flags |= force_saturated;
    tick.force += std::min(share, 1.0) * more;
    return std::min(share, 1.0);
  };
  tick.force = push;
  if (const double length = push.norm(); length > max_force_) {
    tick.force *= max_force_ / length;
    tick.flags |= force_saturated;
  }
  tick.vibration = add(beside) * rough.vibration;
  tick.transient = add(ringing) * ringing;
  if (const double length = tick.force.norm(); length > max_force_)
    tick.force *= (1.0 - 1e-15) * max_force_ / length;  // after rounding, too
  return tick;
}

}  // namespace palpate
