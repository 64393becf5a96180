// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/paper/paper.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/kernel/paper/motion.hpp"

namespace palpate {

Paper::Paper(const Parameters& parameters, Variant variant)
    : variant_(variant),
      parameters_(parameters),
      mover_({.proxy = parameters.proxy, .fixed_step = variant == Variant::fixed_step}) {
  validate(parameters_);
}

void Paper::set_parameters(const Parameters& parameters) noexcept {
  parameters_ = parameters;
  mover_.set({.proxy = parameters.proxy, .fixed_step = variant_ == Variant::fixed_step});
}

void Paper::seat(const Vec3& proxy) noexcept {
  if (!is_place(proxy)) return;
  proxy_ = {};
  proxy_.at = proxy;
  velocity_ = 0.0;
  velocity_update_due_ = false;
  distance_rate_.reset();
  mover_.invalidate();
}

void Paper::observe(const Observation& seen) noexcept {
  const bool as_printed = variant_ == Variant::as_printed;
  frame_.take(seen, 1.0 / parameters_.motion.frame_rate, as_printed);
  mover_.invalidate();
  // Another camera's picture of the same moment: nothing can have moved since.
  if (frame_.in_order() && !frame_.advances()) return;
  velocity_update_due_ = false;
  // Without contact there is no normal to move along and nothing to measure a velocity against:
  // the estimate starts again from 0 (the print leaves this open).
  if (variant_ == Variant::fixed_step || !proxy_.touching || !proxy_.normal || !frame_.in_order()) {
    velocity_ = 0.0;
    return;
  }
  if (!as_printed && frame_.interval() > parameters_.motion.max_extrapolation) {
    // After a gap in the stream a velocity says little: go no farther than it is trusted, and let
    // (13) start from what that means over the whole gap.
    velocity_ *= parameters_.motion.max_extrapolation / frame_.interval();
  }
  *proxy_.at += frame_correction(velocity_, *proxy_.normal, frame_.interval());  // Step 1, Eq. (3)
  velocity_update_due_ = true;
}

// Section 4.6.
Vec3 Paper::render_force(const Vec3& hip, double t, std::uint32_t& flags) noexcept {
  if (!proxy_.touching) {
    distance_rate_.reset();
    return Vec3::Zero();
  }
  const bool as_printed = variant_ == Variant::as_printed;
  double elapsed = std::max(t - frame_.stamp(), 0.0);
  if (!as_printed) elapsed = std::min(elapsed, parameters_.motion.max_extrapolation);
  const Vec3 u = extrapolated_u(hip - *proxy_.at, velocity_, proxy_.normal.value_or(Vec3::Zero()),
                                elapsed, as_printed);
  const CouplingForce result =
      coupling_force(parameters_.coupling, u, distance_rate_.update(u.norm(), t),
                     parameters_.proxy.r_c(), as_printed);
  if (result.saturated) flags |= force_saturated;
  return result.force;
}

Tick Paper::tick(const Vec3& hip, double t) noexcept {
  auto [tick, can_move] = begin_tick(proxy_, frame_, hip, t);
  if (!can_move) return tick;

  const Vec3 normal_before = proxy_.normal.value_or(Vec3::Zero());  // n_(k-1) of (13)
  const Movement movement = mover_.move(proxy_, *frame_.cloud(), hip);
  if (velocity_update_due_) {
    velocity_ = updated_velocity(velocity_, normal_before, movement.first_step,
                                 frame_.interval());  // Eq. (13)
    velocity_update_due_ = false;
  }
  finish_movement(proxy_, movement);
  if (!proxy_.touching) velocity_ = 0.0;

  write_movement(proxy_, movement, mover_.patch(), frame_, parameters_.motion.max_extrapolation,
                 tick);
  tick.force = render_force(hip, t, tick.flags);
  tick.surface_velocity = velocity_;
  if ((tick.flags & frame_stale) == 0 || variant_ == Variant::as_printed)
    tick.surface_motion = velocity_ * proxy_.normal.value_or(Vec3::Zero());
  return tick;
}

}  // namespace palpate
