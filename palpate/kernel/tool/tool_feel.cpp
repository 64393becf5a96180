// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/tool/tool_feel.hpp"

#include <algorithm>

#include "palpate/kernel/feel/friction.hpp"

namespace palpate {

void ToolFeel::set(const Parameters& parameters) noexcept {
  scene_ = material_of(parameters);
  friction_ = parameters.friction;
  stiffness_ = parameters.coupling.stiffness;
  max_force_ = parameters.coupling.max_force;
  forget_materials();
}

void ToolFeel::take(const Observation& seen) noexcept {
  clouds_.take(seen.camera, seen.cloud);
  forget_materials();
}

void ToolFeel::forget_materials() noexcept {
  feels_ = has_feel(scene_, stiffness_) || clouds_.has_materials();
  for (ContactMaterial& each : here_) each.forget();
}

const Material& ToolFeel::look(std::size_t patch, const Vec3& place, const Vec3& normal) noexcept {
  here_[patch].look(clouds_, scene_, stiffness_, place, normal);
  return here_[patch].material;
}

double ToolFeel::friction(std::size_t patch, const Vec3& place, const Vec3& normal,
                          double speed) noexcept {
  const Material& material = look(patch, place, normal);
  friction_.friction = material.friction;
  friction_.kinetic_share = material.kinetic_share;
  return friction_coefficient(friction_, speed);
}

// Hazard: material-energy, material-force
void ToolFeel::press(std::span<Pushed> contacts, const Movement& movement, Tick& tick) noexcept {
  if (!feels_) return;
  double all = 0.0, hard = 0.0, most = 0.0;
  const Pushed* hardest = nullptr;
  Vec3 more = Vec3::Zero(), more_torque = Vec3::Zero(), drag = Vec3::Zero();
  for (Pushed& contact : contacts) {
    const Material& material = look(contact.patch, contact.place, contact.normal);
    const ContactMaterial& here = here_[contact.patch];
    const double pressed = contact.force.dot(contact.normal);
    const double away = contact.velocity.dot(contact.normal);
    const double share = std::min(material.stiffness / std::max(stiffness_, 1e-9), 1.0);
    const Vec3 beside = here.downhill(contact.normal) -
                        material.viscosity * (contact.velocity - away * contact.normal);
    const double felt = share * here.cushion(away);
    const Vec3 change = (felt - 1.0) * contact.force + felt * pressed * beside;
    more += change;
    more_torque += contact.lever.cross(change);
    drag += contact.force - pressed * contact.normal;
    contact.force += change;
    all += pressed;
    hard += share * pressed;
    if (pressed > most) {
      most = pressed;
      hardest = &contact;
    }
  }
  if (hardest == nullptr) return;
  // Where the mean stiffness rises, the tank pays for it.
  const double wanted = hard / all;
  const Hardness::Felt felt = hardness_.update(
      wanted, tick.force, stiffness_, -drag_.dot(movement.by), movement.by, movement.velocity);
  drag_ = drag;
  tick.hardness = felt.share;
  const double paid = wanted > 0.0 ? felt.share / wanted : 1.0;
  const ContactMaterial& here = here_[hardest->patch];
  struck_ = here.material.tap;
  double vibration = 0.0;
  if (const TextureParameters& texture = here.material.texture; texture.grain > 0.0) {
    const double away = hardest->velocity.dot(hardest->normal);
    const double speed = (hardest->velocity - away * hardest->normal).norm();
    vibration = here.vibration(grain_.update(texture.grain_length, speed, movement.dt));
  } else {
    grain_.reset();
  }
  for (Pushed& contact : contacts) contact.force *= paid;
  tick.force = paid * (tick.force + more) + felt.brake;
  tick.torque = (1.0 + vibration) * paid * (tick.torque + more_torque);
  tick.vibration = vibration * tick.force;
  tick.force += tick.vibration;
}

void ToolFeel::ring(const Movement& movement, Tick& tick) noexcept {
  if (!feels_) return;
  approach_ += Tap::approach_share(movement.dt) * (movement.velocity - approach_);
  const double pressed = tick.force.norm();
  if (!(pressed > 0.0)) {
    hardness_.reset();
    grain_.reset();
    drag_ = Vec3::Zero();
  }
  const Vec3 ringing =
      tap_.update(pressed, tick.normal, -approach_.dot(tick.normal), struck_, tick.t);
  tick.transient = share_within(max_force_, tick.force, ringing) * ringing;
  tick.force += tick.transient;
}

}  // namespace palpate
