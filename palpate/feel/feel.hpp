// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "palpate/core/hand_velocity.hpp"
#include "palpate/core/method.hpp"
#include "palpate/feel/friction.hpp"

namespace palpate {

/// What a surface feels like, around any method: the method renders how far away it is, and this
/// adds the tangential force of friction. docs/friction.md.
///
/// Proxy, normal and state stay the method's. Without friction its ticks are passed on as they are,
/// bit for bit.
class Feel final : public Method {
 public:
  /// @param method  what renders the normal force; not null
  Feel(std::unique_ptr<Method> method, const Parameters& parameters);

  void seat(const Vec3& proxy) noexcept override;
  void frame(const Cloud& cloud, double stamp) noexcept override;
  Tick tick(const Vec3& hip, double t) noexcept override;
  void set_parameters(const Parameters& parameters) override;
  [[nodiscard]] const Patch* patch() const noexcept override { return method_->patch(); }
  void check(const Cloud& cloud) const override { method_->check(cloud); }

 private:
  void take(const Parameters& parameters) noexcept;

  std::unique_ptr<Method> method_;
  bool rough_ = false;  // is there anything to add?
  double max_force_ = 0.0;
  Friction friction_;
  HandVelocity hand_;
  Vec3 last_hip_ = Vec3::Zero();
};

}  // namespace palpate
