// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "palpate/kernel/core/hand_velocity.hpp"
#include "palpate/kernel/core/method.hpp"
#include "palpate/kernel/feel/contact_material.hpp"
#include "palpate/kernel/feel/friction.hpp"
#include "palpate/kernel/feel/grain.hpp"
#include "palpate/kernel/feel/hardness.hpp"
#include "palpate/kernel/feel/tap.hpp"

namespace palpate {

/// Adds material effects (stiffness, friction, texture, impact vibration) to the force of any
/// method. docs/materials.md, docs/friction.md.
///
/// Proxy, normal and state remain those of the method. Without active material effects, the ticks
/// are passed on unchanged, bit for bit.
class Feel final : public Method {
 public:
  /// @param method  what renders the normal force; not null
  Feel(std::unique_ptr<Method> method, const Parameters& parameters);

  void seat(const Vec3& proxy) noexcept override;
  void observe(const Observation& seen) noexcept override;
  Tick tick(const Vec3& hip, double t) noexcept override;
  Tick tick(const HandPose& hand, double t) noexcept override;
  void set_parameters(const Parameters& parameters) noexcept override;
  [[nodiscard]] const Patch* patch() const noexcept override { return method_->patch(); }
  void check(const Cloud& cloud) const override { method_->check(cloud); }

 private:
  // How the hand has moved since the tick before.
  struct Movement {
    Vec3 by = Vec3::Zero();        // [m] relative to the surface
    Vec3 velocity = Vec3::Zero();  // [m/s] the same
    double dt = 0.0;               // [s]
  };

  void take(const Parameters& parameters) noexcept;
  void look_whether_to_feel() noexcept;
  void forget_contact() noexcept;
  Movement move(const Tick& tick, const Vec3& normal) noexcept;
  struct Texture {
    Vec3 force = Vec3::Zero(), vibration = Vec3::Zero();  // [N] of relief and grains; of these
  };
  Texture texture(const Vec3& push, const Movement& movement) noexcept;

  std::unique_ptr<Method> method_;
  ObservedClouds clouds_;
  bool feels_ = false;  // is there anything to add?
  double max_force_ = 0.0;
  double stiffness_ = 0.0;
  double contact_radius_ = 0.0;
  FrictionParameters bristles_;
  Material scene_;  // where no other is

  ContactMaterial here_;  // under the foot
  Hardness hardness_;
  Friction friction_;
  Grain grain_;
  Tap tap_;
  Vec3 drag_ = Vec3::Zero();  // [N] of friction in the tick before
  HandVelocity hand_;
  Vec3 approach_ = Vec3::Zero();  // [m/s] of the hand relative to the surface, smoothed for longer
  Vec3 last_hip_ = Vec3::Zero();
};

}  // namespace palpate
