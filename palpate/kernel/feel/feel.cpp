// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/feel/feel.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {
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
  here_.forget();
  look_whether_to_feel();
}

void Feel::look_whether_to_feel() noexcept {
  feels_ = has_feel(scene_, stiffness_) || clouds_.has_materials();
  if (feels_) return;
  forget_contact();
  hand_.reset();
}

void Feel::forget_contact() noexcept {
  here_.forget();
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
  here_.forget();
  look_whether_to_feel();
}

// @param normal  [-] unit, of the force, which may lean off the surface's
Feel::Movement Feel::move(const Tick& tick, const Vec3& normal) noexcept {
  const Vec3 motion = along(tick.surface_motion, normal);
  Movement movement;
  if (hand_.started()) {
    movement.dt = tick.t - hand_.t();
    movement.by = tick.hip - last_hip_ - movement.dt * motion;
  }
  hand_.update(tick.hip, tick.t);
  last_hip_ = tick.hip;
  movement.velocity = hand_.value() - motion;
  approach_ += Tap::approach_share(movement.dt) * (hand_.value() - tick.surface_motion - approach_);
  return movement;
}

// The normal force on a slope of the relief, and the vibration of the grains.
Feel::Texture Feel::texture(const Vec3& push, const Movement& movement) noexcept {
  const double size = push.norm();
  if (!(size > 0.0)) {
    grain_.reset();
    return {};
  }
  const Vec3 normal = push / size;
  Texture felt;
  felt.force = size * here_.downhill(normal);
  if (const TextureParameters& texture = here_.material.texture; texture.grain > 0.0) {
    const Vec3 slide = movement.velocity - movement.velocity.dot(normal) * normal;
    felt.vibration =
        here_.vibration(grain_.update(texture.grain_length, slide.norm(), movement.dt)) * push;
    felt.force += felt.vibration;
  } else {
    grain_.reset();
  }
  return felt;
}

Tick Feel::tick(const Vec3& hip, double t) noexcept { return tick(HandPose{.position = hip}, t); }

// Hazard: material-force
Tick Feel::tick(const HandPose& hand, double t) noexcept {
  Tick tick = method_->tick(hand, t);
  if (!feels_ || (tick.flags & non_finite_input) != 0) return tick;
  const double pressed = tick.force.norm();
  const bool has_direction = pressed > undirected_force || (pressed > 0.0 && tick.normal.isZero());
  const Vec3 normal = has_direction ? Vec3(tick.force / pressed) : tick.normal;
  const Movement movement = move(tick, normal);
  if ((tick.flags & (free_space_released | proxy_let_go)) != 0) forget_contact();

  if (pressed > 0.0)
    here_.look(clouds_, scene_, stiffness_, tick.proxy - contact_radius_ * tick.normal,
               tick.normal);
  // As hard as the material: its spring, and its cushion.
  const Material& material = here_.material;
  const double wanted = std::min(material.stiffness / std::max(stiffness_, 1e-9), 1.0);
  const Hardness::Felt felt = hardness_.update(
      wanted, tick.force, stiffness_, -drag_.dot(movement.by), movement.by, movement.velocity);
  tick.hardness = felt.share;
  const Vec3 push = felt.share * here_.cushion(movement.velocity.dot(normal)) * tick.force;

  bristles_.friction = material.friction;
  bristles_.kinetic_share = material.kinetic_share;
  bristles_.viscosity = material.viscosity;
  friction_.set(bristles_);
  drag_ = friction_.update(push, movement.by, movement.velocity, movement.dt);
  const Texture rough = texture(push, movement);
  const Vec3 beside = drag_ + felt.brake + rough.force;
  const Vec3 ringing = tap_.update(pressed, normal, -approach_.dot(normal), material.tap, t);

  // Together no more than the limit: the normal force comes first, the ringing last.
  const auto add = [&](const Vec3& more) {
    const double share = share_within(max_force_, tick.force, more);
    if (share < 1.0 && more.squaredNorm() > 0.0) tick.flags |= force_saturated;
    tick.force += share * more;
    return share;
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
