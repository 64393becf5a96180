// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/renderer.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/core/coupling.hpp"
#include "palpate/core/motion.hpp"

namespace palpate {
namespace {

// A gather reaches beyond r_3 by as much as the proxy may travel, between these multiples of r_c:
// less would make slow slides gather anew every few steps, more would make every loop longer.
constexpr double least_margin = 0.2;
constexpr double most_margin = 4.0;

// A step shorter than this [m] is none: the proxy is blocked where it is.
constexpr double no_step = 1e-12;

// Coordinates beyond this [m] are no place that a hand can be.
constexpr double farthest = 1e6;

bool is_place(const Vec3& p) {
  return p.allFinite() && p.cwiseAbs().maxCoeff() <= farthest;
}

}  // namespace

struct Renderer::Movement {
  Surroundings around{ContactState::free_motion, std::nullopt};
  int steps = 0;
  bool touched = false;  // in contact or entrenched at any step of this tick
  std::uint32_t flags = 0;
};

Renderer::Renderer(const Parameters& parameters) : parameters_(parameters) {
  validate(parameters_);
}

void Renderer::set_parameters(const Parameters& parameters) {
  validate(parameters);
  parameters_ = parameters;
  patch_is_stale_ = true;
}

void Renderer::seat(const Vec3& proxy) noexcept {
  if (!is_place(proxy)) return;
  proxy_ = proxy;
  normal_.reset();
  touching_ = false;
  velocity_ = 0.0;
  velocity_update_due_ = false;
  last_distance_.reset();
  patch_is_stale_ = true;
}

void Renderer::frame(const Cloud& cloud, double stamp) noexcept {
  const bool as_printed = parameters_.method == Method::paper_as_printed;
  const double nominal = 1.0 / parameters_.motion.frame_rate;
  interval_ = as_printed || frame_count_ == 0 ? nominal : stamp - stamp_;
  stamp_ok_ = std::isfinite(stamp) && interval_ > 0.0;
  if (std::isfinite(stamp)) stamp_ = stamp;
  cloud_ = &cloud;
  ++frame_count_;
  patch_is_stale_ = true;
  velocity_update_due_ = false;

  // Without contact there is no normal to move along and nothing to measure a velocity against:
  // the estimate starts again from 0 (the print leaves this open).
  if (parameters_.method == Method::fixed_step || !touching_ || !normal_ || !stamp_ok_) {
    velocity_ = 0.0;
    return;
  }
  if (!as_printed && interval_ > parameters_.motion.max_extrapolation) {
    // After a gap in the stream a velocity says little: go no farther than it is trusted, and let
    // (13) start from what that means over the whole gap.
    velocity_ *= parameters_.motion.max_extrapolation / interval_;
  }
  *proxy_ += frame_correction(velocity_, *normal_, interval_);  // Step 1, Eq. (3)
  velocity_update_due_ = true;
}

// Gathers the points about the proxy unless the patch already holds all within r_3 of it.
void Renderer::cover(double travel) noexcept {
  const double room = patch_.ball().radius - (*proxy_ - patch_.ball().centre).norm();
  if (!patch_is_stale_ && room >= parameters_.proxy.r_3) return;
  const double r_c = parameters_.proxy.r_c();
  const double margin = std::clamp(travel, least_margin * r_c, most_margin * r_c);
  gather(*cloud_, Ball{*proxy_, parameters_.proxy.r_3 + margin}, patch_);
  patch_is_stale_ = false;
}

// Movement steps 2 to 7 of section 4.3.
Renderer::Movement Renderer::move_proxy(const Vec3& hip) noexcept {
  const ProxyParameters& parameters = parameters_.proxy;
  const Vec3 normal_before = normal_.value_or(Vec3::Zero());  // n_(k-1) of (13)
  Movement movement;
  int contact_steps = 0;
  for (;;) {
    const Vec3 u = hip - *proxy_;
    // In contact the proxy can be expected to travel along the surface and away from it only.
    const double into = touching_ && normal_ ? std::min(u.dot(*normal_), 0.0) : 0.0;
    cover(std::sqrt(std::max(u.squaredNorm() - into * into, 0.0)));

    movement.around = look_around(patch_, *proxy_, parameters);  // Step 2
    const Surroundings& around = movement.around;
    const bool touches = around.state != ContactState::free_motion;
    movement.touched = movement.touched || touches;
    if (touches) {
      if (around.normal) {
        normal_ = around.normal;
      } else {
        movement.flags |= normal_undefined;
      }
    }
    if (has_converged(around, u, parameters)) break;  // Step 7, Eq. (8)
    if (movement.steps == parameters.step_budget) {
      movement.flags |= step_budget_hit;
      break;
    }

    const Vec3 normal = around.normal.value_or(normal_.value_or(Vec3::Zero()));
    const double room = patch_.ball().radius - (*proxy_ - patch_.ball().centre).norm();
    const Vec3 step = parameters_.method == Method::fixed_step
                          ? fixed_proxy_step(around, normal, u, parameters)
                          : proxy_step(patch_, *proxy_, around, normal, u, room - parameters.r_c(),
                                       contact_steps, parameters);  // Steps 3 to 6
    if (velocity_update_due_) {
      velocity_ = updated_velocity(velocity_, normal_before, step, interval_);  // Eq. (13)
      velocity_update_due_ = false;
    }
    if (step.norm() <= no_step) break;
    if (around.state == ContactState::contact) ++contact_steps;
    *proxy_ += step;
    ++movement.steps;
  }
  velocity_update_due_ = false;  // converged at once: s_k = 0 leaves (13) as it is
  return movement;
}

// Section 4.6.
Vec3 Renderer::render_force(const Vec3& hip, double t, std::uint32_t& flags) noexcept {
  if (!touching_) {
    last_distance_.reset();
    return Vec3::Zero();
  }
  const bool as_printed = parameters_.method == Method::paper_as_printed;
  double elapsed = std::max(t - stamp_, 0.0);
  if (!as_printed) elapsed = std::min(elapsed, parameters_.motion.max_extrapolation);
  const Vec3 u =
      extrapolated_u(hip - *proxy_, velocity_, normal_.value_or(Vec3::Zero()), elapsed, as_printed);
  const double distance = u.norm();
  const double dt = t - last_t_;
  const double rate = last_distance_ && dt > 0.0 ? (distance - *last_distance_) / dt : 0.0;
  last_distance_ = distance;
  last_t_ = t;
  const CouplingForce result =
      coupling_force(parameters_.coupling, u, rate, parameters_.proxy.r_c(), as_printed);
  if (result.saturated) flags |= force_saturated;
  return result.force;
}

Tick Renderer::tick(const Vec3& hip, double t) noexcept {
  Tick tick{.t = t,
            .hip = hip,
            .proxy = proxy_.value_or(Vec3::Zero()),
            .normal = Vec3::Zero(),
            .force = Vec3::Zero(),
            .state = ContactState::free_motion,
            .steps = 0,
            .surface_velocity = 0.0,
            .frame = frame_count_ - 1,
            .flags = 0};
  if (!is_place(hip) || !std::isfinite(t)) {
    tick.flags = non_finite_input;
    return tick;
  }
  if (cloud_ == nullptr) {
    proxy_ = hip;
    tick.proxy = hip;
    tick.flags = no_frame;
    return tick;
  }
  if (!proxy_) proxy_ = hip;

  const Movement movement = move_proxy(hip);
  tick.flags = movement.flags;
  // The contact shell is 0.02 mm thick, so a proxy that slides on noise leaves it for single steps.
  // What counts is where it came to rest; if it did not come to rest, whether it touched at all.
  touching_ = movement.around.state != ContactState::free_motion ||
              ((movement.flags & step_budget_hit) != 0 && movement.touched);
  if (!touching_) {
    velocity_ = 0.0;
    normal_.reset();
  }
  tick.proxy = *proxy_;
  tick.normal = movement.around.normal.value_or(normal_.value_or(Vec3::Zero()));
  tick.force = render_force(hip, t, tick.flags);
  tick.state = movement.around.state;
  tick.steps = movement.steps;
  tick.surface_velocity = velocity_;
  if (patch_.thinned()) tick.flags |= patch_thinned;
  if (!stamp_ok_) tick.flags |= stamp_not_increasing;
  if (t - stamp_ > parameters_.motion.max_extrapolation) tick.flags |= frame_stale;
  return tick;
}

}  // namespace palpate
