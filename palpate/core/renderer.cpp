// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/coupling.hpp"
#include "palpate/core/motion.hpp"

namespace palpate {
namespace {

// A gather reaches beyond r_3 by as much as the proxy may travel, between these multiples of r_c:
// less would make slow slides gather anew every few steps, more would make every loop longer.
constexpr double least_margin = 0.2;
constexpr double most_margin = 4.0;

// Coordinates beyond this [m] are no place that a hand can be.
constexpr double farthest = 1e6;

bool is_place(const Vec3& p) {
  return p.allFinite() && p.cwiseAbs().maxCoeff() <= farthest;
}

}  // namespace

struct Renderer::Movement {
  ContactState state = ContactState::free_motion;
  Vec3 normal = Vec3::Zero();  // [-] unit; zero where there is none
  int steps = 0;
  bool touched = false;  // in contact or entrenched at any step of this tick
  std::uint32_t flags = 0;
};

Renderer::Renderer(const Parameters& parameters)
    : parameters_(parameters), cos_theta_(std::cos(parameters.proxy.theta)) {
  validate(parameters_);
}

void Renderer::set_parameters(const Parameters& parameters) {
  validate(parameters);
  if (parameters.method != parameters_.method) sight_.forget();
  parameters_ = parameters;
  cos_theta_ = std::cos(parameters.proxy.theta);
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
  sight_.forget();
  on_fit_ = false;
  points_moved_ = Vec3::Zero();
  last_force_ = Vec3::Zero();
  blend_offset_ = Vec3::Zero();
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

  if (parameters_.method == Method::sight) {
    frame_by_sight(cloud);
    return;
  }
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

// A frame seen along the lines of sight: docs/method.md, "Sight".
void Renderer::frame_by_sight(const Cloud& cloud) noexcept {
  blend_due_ = true;
  // What the surface's own motion adds to the force from the last tick on.
  carried_rate_ =
      sight_.tracking()
          ? (sight_.surface().travel(last_t_) - sight_.surface().travel(last_t_ - 1e-3)) / 1e-3
          : 0.0;
  behind_ = false;
  points_moved_ = Vec3::Zero();
  if (!proxy_) return;
  if (!stamp_ok_) interval_ = 1.0 / parameters_.motion.frame_rate;
  // What was hidden is remembered for a hand that is at it, or may be soon again.
  constexpr double leaves = 20e-3;  // [m]
  if (sight_.holding() && !(touching_ && on_fit_) &&
      sight_.contact(*proxy_, stamp_).distance > parameters_.proxy.r_c() + leaves) {
    sight_.forget();
  }
  constexpr double infinite = std::numeric_limits<double>::infinity();
  using Event = SightTracker::Event;
  const Event event = sight_.frame(cloud, stamp_, interval_, *proxy_,
                                   touching_ ? parameters_.sight.hardest_strike : infinite);
  if (event != Event::followed && event != Event::jumped) return;
  // Side repair: the proxy was on the surface's free side and has to be there still.
  // One that will move over points has to be in front of this frame's, not only of the average.
  const SurfaceContact contact = sight_.contact(*proxy_, stamp_);
  const double r_c = parameters_.proxy.r_c();
  const double least = touching_ && !sight_.smooth() ? r_c + sight_.surface().clearance() : r_c;
  if (contact.distance < least) *proxy_ = contact.foot + least * contact.normal;
  behind_ = sight_.shows_behind(cloud, *proxy_, parameters_.proxy.r_c());
}

// Movement on the fitted surface where it describes the points well, on the points elsewhere.
Renderer::Movement Renderer::move_by_sight(const Vec3& hip, double t) noexcept {
  // How far from the fitted surface the points' noise can stop a proxy.
  constexpr double near = 10e-3;
  constexpr int most_slides = 6;
  // A proxy does not touch the bottom of a trough much narrower than itself, but its flanks.
  constexpr double deepest = 0.7;  // [-] r_c times curvature
  const double r_c = parameters_.proxy.r_c();
  if (!touching_) sight_.watch(*cloud_, *proxy_);

  Movement movement;
  int slides = 0;
  const auto rest_on_fit = [&] {
    while (sight_.smooth()) {
      const SurfaceContact contact = sight_.contact(hip, t);
      if (contact.distance > r_c + near + 4.0 * sight_.surface().spread()) return false;
      if (contact.curvature * r_c > deepest || !sight_.faces(contact.normal)) return false;
      if (contact.at_limit && !sight_.holding()) {
        if (slides == most_slides) movement.flags |= step_budget_hit;
        if (slides++ < most_slides && sight_.slide(*cloud_, contact.foot)) continue;
        if (!sight_.smooth()) return false;
      }
      ++movement.steps;
      if (contact.distance >= r_c) {
        if (sight_.holding()) return false;  // what else is there, the points tell
        proxy_ = hip;
        movement.state = ContactState::free_motion;
        movement.normal = contact.normal;
      } else {
        proxy_ = contact.foot + r_c * contact.normal;
        movement.state = ContactState::contact;
        movement.normal = contact.normal;
        movement.touched = true;
        normal_ = contact.normal;
      }
      return true;
    }
    return false;
  };

  const bool close =
      on_fit_ || (sight_.smooth() && sight_.contact(*proxy_, t).distance <=
                                         r_c + near + 4.0 * sight_.surface().spread());
  if (close && rest_on_fit()) {
    on_fit_ = true;
    patch_is_stale_ = true;
    points_moved_ = sight_.travel(t);
    return movement;
  }
  on_fit_ = false;
  const int steps = movement.steps + slides;
  // The points that the fit describes move on with it, and a proxy that touches them with them.
  const Vec3 moved =
      sight_.tracking() && sight_.surface().smooth() ? sight_.travel(t) : Vec3(Vec3::Zero());
  *proxy_ -= points_moved_;
  const Vec3 before = *proxy_;
  movement = move_over_points(hip - moved);
  movement.steps += steps;
  // Points that scatter can let the proxy through. Its line of sight tells.
  if (const std::optional<Vec3> front = sight_.in_front(*cloud_, before, *proxy_, r_c)) {
    movement.state = ContactState::contact;
    movement.normal = (*front - *proxy_).normalized();
    movement.touched = true;
    normal_ = movement.normal;
    proxy_ = front;
  }
  const bool touched = movement.touched && normal_;
  if (touched) sight_.touch(*cloud_, *proxy_ - r_c * *normal_, *normal_);
  *proxy_ += moved;
  points_moved_ = moved;
  if (touched && rest_on_fit()) on_fit_ = true;
  return movement;
}

// Gathers the points about a place from where the proxy is drawn to the HIP by u.
void Renderer::cover(const Vec3& at, const Vec3& u, const Vec3& contact_normal) noexcept {
  const double r_c = parameters_.proxy.r_c();
  // In contact the proxy can be expected to travel along the surface and away from it only.
  const double into = touching_ ? std::min(u.dot(contact_normal.normalized()), 0.0) : 0.0;
  const double travel = std::sqrt(std::max(u.squaredNorm() - into * into, 0.0));
  const double margin = std::clamp(travel, least_margin * r_c, most_margin * r_c);
  const Ball ball{at, parameters_.proxy.r_3 + margin};
  gather(*cloud_, ball, patch_);
  if (parameters_.method == Method::sight && parameters_.sight.side_depth > 0.0) {
    cloud_->gather_sides(ball, {2.0 * r_c, parameters_.sight.side_depth}, Patch::capacity, patch_);
  }
  patch_is_stale_ = false;
}

// The proxy's movement over the points: section 4.3.
Renderer::Movement Renderer::move_over_points(const Vec3& hip) noexcept {
  const Vec3 normal_before = normal_.value_or(Vec3::Zero());  // n_(k-1) of (13)
  ProxyMovement proxy{.at = *proxy_, .contact_normal = normal_before};
  MovementEnd end = MovementEnd::patch_left;
  if (patch_is_stale_) {
    cover(proxy.at, hip - proxy.at, proxy.contact_normal);
  } else if (*proxy_ == looked_at_) {  // where the last tick ended its look is still good
    proxy.looked = true;
    proxy.state = state_;
    proxy.normal = direction_;
  }
  for (;;) {
    end = move_proxy(patch_, hip, parameters_.proxy, cos_theta_,
                     parameters_.method == Method::fixed_step, proxy);
    if (end != MovementEnd::patch_left) break;
    cover(proxy.at, hip - proxy.at, proxy.contact_normal);
  }
  if (velocity_update_due_) {
    velocity_ =
        updated_velocity(velocity_, normal_before, proxy.first_step, interval_);  // Eq. (13)
    velocity_update_due_ = false;
  }
  proxy_ = looked_at_ = proxy.at;
  state_ = proxy.state;
  direction_ = proxy.normal;
  if (!proxy.contact_normal.isZero(0.0)) normal_ = proxy.contact_normal.normalized();
  Movement movement{
      .state = proxy.state, .normal = proxy.normal, .steps = proxy.steps, .touched = proxy.touched};
  movement.normal.normalize();  // zero stays zero
  if (end == MovementEnd::budget_spent) movement.flags |= step_budget_hit;
  if (proxy.normal_undefined) movement.flags |= normal_undefined;
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
  Vec3 u =
      extrapolated_u(hip - *proxy_, velocity_, normal_.value_or(Vec3::Zero()), elapsed, as_printed);
  // On points that are still where they were, the hand feels how the surface moves all the same.
  if (sight_.tracking()) u -= sight_.travel(t) - points_moved_;
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

// What a frame corrected at once in the geometry reaches the hand over most of an interval, and a
// surface that is no longer seen fades.
Vec3 Renderer::blend_force(const Vec3& force, const Vec3& hip, double t) noexcept {
  constexpr double blend = 0.85;    // [intervals]
  const auto ease = [](double x) {  // from 1 to 0 with slopes 0
    x = std::clamp(x, 0.0, 1.0);
    return 1.0 - x * x * (3.0 - 2.0 * x);
  };
  if (blend_due_) {
    // The force goes on as it would have without the frame, then turns to what the frame says.
    Vec3 carried = last_force_;
    const double push = last_force_.norm();
    if (push > 0.0) {
      const Vec3 outwards = last_force_ / push;
      const double deeper =
          carried_rate_ * (t - last_blend_t_) * sight_.surface().frame().up.dot(outwards) -
          (hip - last_hip_).dot(outwards);
      carried += parameters_.coupling.stiffness * deeper * outwards;
    }
    blend_offset_ = carried - force;
    blend_start_ = t;
    blend_due_ = false;
  }
  Vec3 blended = force + ease((t - blend_start_) / (blend * interval_)) * blend_offset_;
  // The rest of an old force may push on, but nothing pulls.
  const Vec3 normal = normal_.value_or(Vec3::Zero());
  const double pull = blended.dot(normal);
  if (pull < 0.0) blended -= pull * normal;
  if (sight_.holding()) {
    const SightParameters& sight = parameters_.sight;
    blended *= ease((t - sight_.held_since() - sight.hidden_hold) / sight.hidden_fade);
  }
  // A single frame is a scan, not a stream that stopped.
  const double late = parameters_.motion.max_extrapolation;
  if (frame_count_ > 1) blended *= ease((t - stamp_ - late) / late);
  const double force_now = blended.norm();
  if (force_now > parameters_.coupling.max_force) {
    blended *= (1.0 - 1e-15) * parameters_.coupling.max_force / force_now;  // after rounding, too
  }
  last_force_ = blended;
  last_hip_ = hip;
  last_blend_t_ = t;
  return blended;
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

  const bool by_sight = parameters_.method == Method::sight;
  const Movement movement = by_sight ? move_by_sight(hip, t) : move_over_points(hip);
  tick.flags = movement.flags;
  // The contact shell is 0.02 mm thick, so a proxy that slides on noise leaves it for single steps.
  // What counts is where it came to rest; if it did not come to rest, whether it touched at all.
  touching_ = movement.state != ContactState::free_motion ||
              ((movement.flags & step_budget_hit) != 0 && movement.touched);
  if (!touching_) {
    velocity_ = 0.0;
    normal_.reset();
  }
  tick.proxy = *proxy_;
  tick.normal = movement.normal.isZero(0.0) ? normal_.value_or(Vec3::Zero()) : movement.normal;
  tick.force = render_force(hip, t, tick.flags);
  if (by_sight) tick.force = blend_force(tick.force, hip, t);
  tick.state = movement.state;
  tick.steps = movement.steps;
  tick.surface_velocity = by_sight && sight_.tracking() ? sight_.surface().velocity() : velocity_;
  if (by_sight && sight_.holding()) tick.flags |= surface_hidden;
  if (by_sight && behind_) tick.flags |= pop_through_suspected;
  if (patch_.thinned()) tick.flags |= patch_thinned;
  if (!stamp_ok_) tick.flags |= stamp_not_increasing;
  if (t - stamp_ > parameters_.motion.max_extrapolation) tick.flags |= frame_stale;
  return tick;
}

}  // namespace palpate
