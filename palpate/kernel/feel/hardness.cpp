// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/feel/hardness.hpp"

#include <algorithm>

namespace palpate {
namespace {

// [N] A contact is over once less than this is left of its force: the spring holds a microjoule.
constexpr double least_force = 1e-3;
// [J] in the tank when a contact begins: what rounding and the hold of a tick may cost.
constexpr double at_first = 1e-5;
// [J] that the tank holds at most: a hand that pressed 5 mm into 600 N/m.
constexpr double most = 7.5e-3;
// [-] of the normal force with which sliding on to a harder material is braked at most.
constexpr double steepest_brake = 0.5;
// [-] of the coupling's stiffness that is missing, from which the brake is at its most.
constexpr double missing_for_all = 0.25;
// [m/s] of sliding, from which the brake is at its most: it is a damper below that.
constexpr double braked_speed = 5e-3;

}  // namespace

// Hazard: material-energy
Hardness::Felt Hardness::update(double wanted, const Vec3& push, double stiffness, double taken,
                                const Vec3& moved, const Vec3& velocity) noexcept {
  const double force = push.norm();
  if (!(force > least_force) || !(stiffness > 0.0)) {
    reset();
    share_ = wanted;
    return {share_, Vec3::Zero()};
  }
  if (!touching_) {
    touching_ = true;
    share_ = wanted;
    level_ = at_first;
    brake_ = Vec3::Zero();
    return {share_, Vec3::Zero()};
  }
  level_ = std::clamp(level_ + taken - brake_.dot(moved), 0.0, most);
  const double of_all = force * force / (2.0 * stiffness);  // [J] held with all of the stiffness
  const double cost = (wanted - share_) * of_all;
  if (cost <= level_) {
    share_ = wanted;
    level_ = std::min(level_ - cost, most);
  } else {
    share_ += level_ / of_all;
    level_ = 0.0;
  }
  const double missing = wanted - share_;
  const Vec3 normal = push / force;
  const Vec3 slide = velocity - velocity.dot(normal) * normal;
  brake_ = Vec3::Zero();
  if (const double speed = slide.norm(); missing > 0.0 && speed > 0.0) {
    const double size = steepest_brake * share_ * force * std::min(missing / missing_for_all, 1.0) *
                        std::min(speed / braked_speed, 1.0);
    brake_ = -size / speed * slide;
  }
  return {share_, brake_};
}

}  // namespace palpate
