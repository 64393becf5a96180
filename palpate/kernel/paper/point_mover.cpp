// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/paper/point_mover.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/paper/proxy.hpp"

namespace palpate {
namespace {

// A gather reaches beyond r_3 by as much as the proxy may travel, between these multiples of r_c:
// less would make slow slides gather again every few steps, more would make every loop longer.
constexpr double least_margin = 0.2;
constexpr double most_margin = 4.0;

// A surface ends where the one beside it is farther from the camera by this multiple of r_c.
constexpr double side_jump = 2.0;

}  // namespace

void PointMover::set(const Options& options) noexcept {
  options_ = options;
  cos_theta_ = math::cos(options.proxy.theta);
  stale_ = true;
}

void PointMover::seat() noexcept {
  stale_ = true;
  hidden_ = inside_sides_ = false;
}

void PointMover::set_hidden(bool hidden) noexcept {
  hidden_ = hidden;
  if (!hidden || inside_sides_) return;
  inside_sides_ = true;
  stale_ = true;
}

// Gathers the points about a place from where the proxy is drawn to the HIP by u.
void PointMover::cover(const Proxy& proxy, const Cloud& cloud, const Vec3& at, const Vec3& u,
                       const Vec3& contact_normal) noexcept {
  const double r_c = options_.proxy.r_c();
  // In contact the proxy can be expected to travel along the surface and away from it only.
  const double into = proxy.touching ? std::min(u.dot(contact_normal.normalized()), 0.0) : 0.0;
  const double travel = std::sqrt(std::max(u.squaredNorm() - into * into, 0.0));
  const double margin = std::clamp(travel, least_margin * r_c, most_margin * r_c);
  const Ball ball{at, options_.proxy.r_3 + margin};
  const Sides sides{side_jump * r_c, options_.side_depth};
  if (inside_sides_ && !hidden_) {
    patch_.start({at, options_.proxy.r_3});
    cloud.gather_sides(patch_.ball(), sides, Patch::capacity, patch_);
    inside_sides_ = patch_.size() > 0;
  }
  gather(cloud, ball, patch_);
  if (options_.side_depth > 0.0 && !inside_sides_) {
    cloud.gather_sides(ball, sides, Patch::capacity, patch_);
  }
  if (options_.sheet > 0.0) {
    cloud.gather_sheet(ball, {options_.sheet, side_jump * r_c}, Patch::capacity, patch_);
  }
  stale_ = false;
}

Movement PointMover::move(Proxy& proxy, const Cloud& cloud, const Vec3& hip) noexcept {
  ProxyMovement now{.at = *proxy.at, .contact_normal = proxy.normal.value_or(Vec3::Zero())};
  if (stale_) {
    cover(proxy, cloud, now.at, hip - now.at, now.contact_normal);
  } else if (now.at ==
             seen_from_) {  // normal and state found here by the last movement are still valid
    now.looked = true;
    now.state = state_;
    now.normal = direction_;
  }
  MovementEnd end = MovementEnd::patch_left;
  for (;;) {
    end = move_proxy(patch_, hip, options_.proxy, cos_theta_, options_.fixed_step, now);
    if (end != MovementEnd::patch_left) break;
    cover(proxy, cloud, now.at, hip - now.at, now.contact_normal);
    // Nothing covers a way that is no number: no gather would ever be enough.
    if (!patch_.covers(now.at, options_.proxy.r_3)) {
      end = MovementEnd::at_rest;
      break;
    }
  }
  proxy.at = seen_from_ = now.at;
  state_ = now.state;
  direction_ = now.normal;
  if (!now.contact_normal.isZero(0.0)) proxy.normal = now.contact_normal.normalized();
  Movement movement{.state = now.state,
                    .normal = now.normal,
                    .first_step = now.first_step,
                    .steps = now.steps,
                    .touched = now.touched};
  movement.normal.normalize();  // zero stays zero
  if (end == MovementEnd::budget_spent) movement.flags |= step_budget_hit;
  if (now.normal_undefined) movement.flags |= normal_undefined;
  return movement;
}

std::pair<Tick, bool> begin_tick(Proxy& proxy, const NewestFrame& frame, const Vec3& hip,
                                 double t) noexcept {
  Tick tick = free_tick(hip, t, frame.number());
  if (!is_place(hip) || !std::isfinite(t)) {
    tick.proxy = proxy.at.value_or(Vec3::Zero());
    tick.flags = non_finite_input;
    return {tick, false};
  }
  if (!proxy.at || frame.cloud() == nullptr) proxy.at = hip;
  if (frame.cloud() == nullptr) {
    tick.flags = no_frame;
    return {tick, false};
  }
  return {tick, true};
}

void write_movement(const Proxy& proxy, const Movement& movement, const Patch& patch,
                    const NewestFrame& frame, double longest_age, Tick& tick) noexcept {
  tick.proxy = *proxy.at;
  tick.normal = movement.normal.isZero(0.0) ? proxy.normal.value_or(Vec3::Zero()) : movement.normal;
  tick.state = movement.state;
  tick.steps = movement.steps;
  tick.flags = movement.flags;
  if (patch.thinned()) tick.flags |= patch_thinned;
  if (!frame.in_order()) tick.flags |= stamp_not_increasing;
  if (tick.t - frame.stamp() > longest_age) tick.flags |= frame_stale;
}

void finish_movement(Proxy& proxy, const Movement& movement) noexcept {
  proxy.touching = movement.state != ContactState::free_motion ||
                   ((movement.flags & step_budget_hit) != 0 && movement.touched);
  if (!proxy.touching) proxy.normal.reset();
}

}  // namespace palpate
