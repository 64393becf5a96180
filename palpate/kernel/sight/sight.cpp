// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/sight.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate {
namespace {

PointMover::Options mover_options(const Parameters& parameters) {
  // Between points this far apart a sphere of r_c sinks by 6 % of r_c [r_c].
  constexpr double closest = 0.5;
  return {.proxy = parameters.proxy,
          .side_depth = parameters.sight.side_depth,
          .sheet = closest * parameters.proxy.r_c()};
}

}  // namespace

Sight::Sight(const Parameters& parameters)
    : parameters_(parameters), mover_(mover_options(parameters)) {
  validate(parameters);
  set_parameters(parameters);
}

void Sight::set_parameters(const Parameters& parameters) noexcept {
  parameters_ = parameters;
  mover_.set(mover_options(parameters));
  tracker_.set(parameters.sight);
  monitor_.set(parameters.sight);
}

void Sight::seat(const Vec3& proxy) noexcept {
  if (!is_place(proxy)) return;
  proxy_ = {};
  proxy_.at = proxy;
  hand_velocity_.reset();
  mover_.seat();
  tracker_.forget();
  for (FusedImage& each : fused_) each.forget();
  monitor_.forget();
  last_proxy_.reset();
  returning_ = false;
  on_fit_ = false;
  points_moved_ = Vec3::Zero();
  last_force_ = Vec3::Zero();
  blend_offset_ = Vec3::Zero();
}

// [s] between the newest two frames of the newest one's camera; the nominal one where their stamps
// do not increase.
double Sight::interval() const noexcept {
  return frame_.in_order() ? frame_.camera_interval() : 1.0 / parameters_.motion.frame_rate;
}

// The averaged points that the proxy rests on; null if it rests on a fit, or none are.
const FusedImage* Sight::fused() const noexcept {
  const std::size_t camera = tracker_.surface().camera();
  if (on_fit_ || !tracker_.tracking() || camera >= most_fused) return nullptr;
  return fused_[camera].active() ? &fused_[camera] : nullptr;
}

// What each camera saw last, averaged where it is.
ObservedClouds Sight::points() const noexcept {
  ObservedClouds points = *frame_.cloud();
  for (std::size_t i = 0; i < most_fused; ++i)
    if (fused_[i].active()) points.take(i, fused_[i]);
  return points;
}

// How far what the proxy rests on has moved at time t [s] since its frame [m, world].
Vec3 Sight::displacement(double t) const noexcept {
  if (const FusedImage* points = fused()) return points->displacement(t);
  return tracker_.tracking() ? tracker_.displacement(t) : Vec3(Vec3::Zero());
}

// [m/s, world] of that, as it is rendered at time t [s].
Vec3 Sight::surface_velocity(double t) const noexcept {
  constexpr double dt = 1e-3;  // [s]
  return (displacement(t) - displacement(t - dt)) / dt;
}

// [frames] A fit may describe what is none by chance: after so many on it points are forgotten.
constexpr int most_frames_on_fit = 8;

// Averages the newest frame's points into those of its camera while the proxy rests on them, or
// would where it is about to touch.
void Sight::fuse(const Observation& seen, SightTracker::Event event) noexcept {
  if (seen.camera >= most_fused) return;
  FusedImage& fused = fused_[seen.camera];
  const DepthImage* image = seen.cloud.image();
  const SurfaceEstimate& surface = tracker_.surface();
  const bool touches = proxy_.touching && proxy_.normal;
  frames_on_fit_ = on_fit_ || (!touches && surface.smooth()) ? frames_on_fit_ + 1 : 0;
  if (image == nullptr || event != SightTracker::Event::followed ||
      frames_on_fit_ > most_frames_on_fit) {
    fused.forget();
    return;
  }
  fused.observe(*image,
                {.place = touches ? Vec3(*proxy_.at - parameters_.proxy.r_c() * *proxy_.normal)
                                  : surface.place(),
                 .radius = surface.resolution(),
                 .stamp = frame_.camera_stamp(),
                 .interval = interval(),
                 .sd = surface.beam_sd()},
                parameters_.sight);
}

// A frame seen along the lines of sight: docs/sight.md, 3.
void Sight::observe(const Observation& seen) noexcept {
  if (seen.camera >= Patch::max_views) return;
  frame_.take(seen, 1.0 / parameters_.motion.frame_rate);
  timing_.frame(frame_.stamp(),
                frame_.in_order() && frame_.count() > 1 ? frame_.camera_interval() : 0.0);
  mover_.invalidate();
  blend_due_ = true;
  // The surface's own velocity, by which the force would go on changing without this frame.
  carried_velocity_ = surface_velocity(hand_velocity_.t());
  monitor_.start_frame(seen.camera);
  const Vec3 points_moved = std::exchange(points_moved_, Vec3::Zero());
  if (!proxy_.at) {
    fuse(seen, SightTracker::Event::none);
    return;
  }
  // A hidden surface is kept only while the proxy is near it.
  constexpr double leaves = 20e-3;  // [m]
  if (tracker_.holding() && !(proxy_.touching && on_fit_) &&
      tracker_.contact(*proxy_.at, frame_.stamp()).distance > parameters_.proxy.r_c() + leaves) {
    tracker_.forget();
  }
  constexpr double infinite = std::numeric_limits<double>::infinity();
  using Event = SightTracker::Event;
  const Event event =
      tracker_.frame(*frame_.cloud(), seen.camera, frame_.camera_stamp(), interval(), last_hip_,
                     *proxy_.at, proxy_.touching ? parameters_.sight.hardest_strike : infinite);
  fuse(seen, event);
  if (event != Event::followed && event != Event::jumped) return;
  // Side repair: the proxy was on the surface's free side and must be there still. If it will move
  // over points, it must be in front of this frame's points, not only of their average.
  if (const FusedImage* points = proxy_.touching ? fused() : nullptr) {
    *proxy_.at += points->correction() - points_moved;
    if (points->is_in_front(*proxy_.at)) return;
  }
  const SurfaceContact contact = tracker_.contact(*proxy_.at, frame_.stamp());
  const double r_c = parameters_.proxy.r_c();
  const double least =
      proxy_.touching && !tracker_.smooth() ? r_c + tracker_.surface().clearance() : r_c;
  if (contact.distance < least) *proxy_.at = contact.foot + least * contact.normal;
}

// Movement on the fitted surface where it describes the points well, on the points elsewhere.
Movement Sight::move(const Vec3& hip, double t) noexcept {
  // How far from the fitted surface the points' noise can stop a proxy.
  constexpr double near = 10e-3;
  constexpr int most_slides = 6;
  // A proxy does not touch the bottom of a trough much narrower than itself, but its flanks.
  constexpr double deepest = 0.7;  // [-] r_c times curvature
  const double r_c = parameters_.proxy.r_c();
  if (!proxy_.touching) tracker_.watch(*frame_.cloud(), *proxy_.at);

  Movement movement;
  int slides = 0;
  const auto rest_on_fit = [&] {
    while (tracker_.smooth()) {
      const SurfaceContact contact = tracker_.contact(hip, t);
      if (contact.distance > r_c + near + 4.0 * tracker_.surface().spread()) return false;
      if (contact.curvature * r_c > deepest || !tracker_.faces(contact.normal)) return false;
      if (contact.at_limit && !tracker_.holding()) {
        if (slides == most_slides) movement.flags |= step_budget_hit;
        const Vec3 velocity = surface_velocity(hand_velocity_.t());
        if (slides++ < most_slides && tracker_.slide(*frame_.cloud(), contact.foot)) {
          // The force goes on smoothly from one fit to the next, as from frame to frame.
          if (on_fit_ && proxy_.touching && !blend_due_) {
            blend_due_ = true;
            carried_velocity_ = velocity;
          }
          continue;
        }
        if (!tracker_.smooth()) return false;
      }
      ++movement.steps;
      if (contact.distance >= r_c) {
        if (tracker_.holding()) return false;  // free of the hidden surface: move over the points
        proxy_.at = hip;
        movement.state = ContactState::free_motion;
        movement.normal = contact.normal;
      } else {
        proxy_.at = contact.foot + r_c * contact.normal;
        movement.state = ContactState::contact;
        movement.normal = contact.normal;
        movement.touched = true;
        proxy_.normal = contact.normal;
      }
      return true;
    }
    return false;
  };

  const bool close =
      on_fit_ || (tracker_.smooth() && tracker_.contact(*proxy_.at, t).distance <=
                                           r_c + near + 4.0 * tracker_.surface().spread());
  if (close && rest_on_fit()) {
    on_fit_ = true;
    mover_.invalidate();
    points_moved_ = tracker_.displacement(t);
    return movement;
  }
  on_fit_ = false;
  const int steps = movement.steps + slides;
  // Between frames the points move with the surface that was fitted to them, and so does a proxy
  // that touches them.
  const bool moves = fused() != nullptr || (tracker_.tracking() && tracker_.surface().smooth());
  const Vec3 moved = moves ? displacement(t) : Vec3(Vec3::Zero());
  *proxy_.at -= points_moved_;
  const Vec3 before = *proxy_.at;
  movement = mover_.move(proxy_, points(), hip - moved);
  movement.steps += steps;
  // Scattered points can let the proxy through; the line of sight through it shows that.
  if (const std::optional<Vec3> front =
          tracker_.in_front(*frame_.cloud(), before, *proxy_.at, r_c)) {
    movement.state = ContactState::contact;
    movement.normal = (*front - *proxy_.at).normalized();
    movement.touched = true;
    proxy_.normal = movement.normal;
    proxy_.at = front;
  }
  const bool touched = movement.touched && proxy_.normal;
  if (touched) tracker_.touch(*frame_.cloud(), *proxy_.at - r_c * *proxy_.normal, *proxy_.normal);
  *proxy_.at += moved;
  points_moved_ = moved;
  if (touched && rest_on_fit()) on_fit_ = true;
  return movement;
}

// Puts the proxy at the hand, without a force.
void Sight::release(const Vec3& hip, Movement& movement) noexcept {
  tracker_.forget();
  mover_.invalidate();
  proxy_ = {};
  proxy_.at = hip;
  on_fit_ = false;
  points_moved_ = Vec3::Zero();
  blend_due_ = false;
  blend_offset_ = Vec3::Zero();
  movement.state = ContactState::free_motion;
  movement.normal = Vec3::Zero();
}

// What the newest frame itself shows overrules every estimate: docs/sight.md, 7.
void Sight::supervise(const Vec3& hip, double t, Movement& movement) noexcept {
  // A frame's correction moves a proxy no farther than a surface is looked for [m].
  constexpr double farthest_move = 0.3;
  const double r_c = parameters_.proxy.r_c();
  if (last_proxy_ && (*proxy_.at - hip).norm() > (*last_proxy_ - hip).norm() + farthest_move) {
    release(hip, movement);
    movement.flags |= proxy_let_go;
  }
  const SightParameters& sight = parameters_.sight;
  const Coupling& coupling = parameters_.coupling;
  const double deepest =
      r_c + std::min(coupling.max_force / std::max(coupling.stiffness, 1e-9), farthest_strike);
  const Monitor::Verdict verdict = monitor_.judge(
      *frame_.cloud(), {.hip = hip,
                        .proxy = *proxy_.at,
                        .normal = proxy_.normal.value_or(Vec3::Zero()),
                        .touching = proxy_.touching || !last_force_.isZero(),
                        .held = tracker_.holding() &&
                                t - tracker_.held_since() < sight.hidden_hold + sight.hidden_fade,
                        .carried = displacement(t),
                        .noise = tracker_.surface().beam_sd(),
                        .r_c = r_c,
                        .deepest = deepest});
  if (verdict.behind) movement.flags |= pop_through_suspected;
  mover_.set_hidden(verdict.hidden);
  switch (verdict.action) {
    case Monitor::Action::none:
      break;
    case Monitor::Action::release:
      release(hip, movement);
      movement.flags |= free_space_released;
      break;
    case Monitor::Action::let_go:
      release(hip, movement);
      movement.flags |= proxy_let_go;
      break;
    case Monitor::Action::return_to_front:
      release(verdict.front, movement);
      tracker_.watch(*frame_.cloud(), verdict.front);
      proxy_.touching = true;
      proxy_.normal = movement.normal = verdict.normal;
      movement.state = ContactState::contact;
      movement.flags |= returned_to_front;
      returns_ = true;
      break;
  }
  last_proxy_ = proxy_.at;
}

// Section 4.6, from the proxy where it will be on the moving surface. The damper acts on the hand's
// velocity relative to the surface. The rate of the distance, as in the paper, would also contain
// every correction of the estimate, and damp noise.
Vec3 Sight::render_force(const Vec3& hip, double t, std::uint32_t& flags) noexcept {
  if (!proxy_.touching) return Vec3::Zero();
  Vec3 u = hip - *proxy_.at;
  // A proxy that rests on points is moved with the surface for the force.
  if (tracker_.tracking()) u -= displacement(t) - points_moved_;
  const Vec3 relative = hand_velocity_.value() - surface_velocity(t);
  const double distance = u.norm();
  const double rate = distance > 0.0 ? relative.dot(u) / distance : 0.0;
  const CouplingForce result =
      coupling_force(parameters_.coupling, u, rate, parameters_.proxy.r_c(), false);
  if (result.saturated) flags |= force_saturated;
  return result.force;
}

// Spreads what a frame corrects over most of an interval, and fades the force of a surface that is
// no longer measured.
Vec3 Sight::blend_force(const Vec3& force, const Vec3& hip, double t) noexcept {
  const double blend = parameters_.sight.blend;
  const auto ease = [](double x) {  // from 1 to 0 with slopes 0
    x = std::clamp(x, 0.0, 1.0);
    return 1.0 - x * x * (3.0 - 2.0 * x);
  };
  if (blend_due_) {
    // The force goes on as it would have without the frame, then turns to what the frame says.
    Vec3 carried = last_force_;
    const double push = last_force_.norm();
    if (push > undirected_force) {
      const Vec3 outwards = last_force_ / push;
      const double deeper =
          (carried_velocity_ * (t - last_blend_t_) - (hip - last_hip_)).dot(outwards);
      carried += parameters_.coupling.stiffness * deeper * outwards;
    }
    blend_offset_ = carried - force;
    blend_start_ = t;
    blend_due_ = false;
  }
  Vec3 blended = force + ease((t - blend_start_) / (blend * interval())) * blend_offset_;
  if (proxy_.normal) left_along_ = *proxy_.normal;
  if (!force.isZero()) left_at_ = hip;
  // The rest of an old force may push on, but nothing pulls, nor in free motion after it.
  const double pull = blended.dot(left_along_);
  if (pull < 0.0) blended -= pull * left_along_;
  // Nor does it follow a hand that leaves: what is left of it ends like a spring's push.
  const double stiffness = std::max(parameters_.coupling.stiffness, 1e-9);
  if (const double gap = (hip - left_at_).dot(left_along_); gap > 0.0) {
    const double rest = blended.norm();
    if (rest > 0.0) blended *= std::max(rest - stiffness * gap, 0.0) / rest;
  }
  if (const double length = blended.norm(); length > parameters_.coupling.max_force)
    blended *= (1.0 - 1e-15) * parameters_.coupling.max_force / length;  // after rounding, too
  last_force_ = blended;
  const SightParameters& sight = parameters_.sight;
  double known = 1.0;
  if (tracker_.holding())
    known = ease((t - tracker_.held_since() - sight.hidden_hold) / sight.hidden_fade);
  // A single frame is a scan, not a stream that stopped. One lost frame is no reason to fade, nor
  // is one before it that was late by half an interval.
  const double fade = std::max(parameters_.motion.max_extrapolation, 1e-3);
  const double late = std::max(fade, 2.5 * timing_.interval());
  if (frame_.count() > 1) known *= ease((timing_.age(t) - late) / fade);
  if (std::exchange(returns_, false)) known = 0.0;
  // The force falls at once with the confidence in the surface. It rises as if the surface came
  // back to the hand at `return_speed`: a handle that nobody holds moves along with it, and swings
  // about that speed by no more than that speed. A force that is ramped up in time throws it. Until
  // the surface is back and r_c farther, what frames correct does not make it come faster.
  const double push = blended.norm();
  const double depth = push / stiffness;
  if (returning_) {
    const double deeper = push > 0.0 ? (last_hip_ - hip).dot(blended) / push : 0.0;
    const double back = sight.return_speed * std::max(t - last_blend_t_, 0.0);
    most_felt_ = std::max(most_felt_ + back + deeper, 0.0);
  }
  if (known < 1.0) {
    most_felt_ = std::min(returning_ ? most_felt_ : depth, known * depth);
    returning_ = true;
  } else if (most_felt_ >= depth + parameters_.proxy.r_c()) {
    returning_ = false;
  }
  if (returning_ && most_felt_ < depth) blended *= most_felt_ / depth;
  last_hip_ = hip;
  last_blend_t_ = t;
  return blended;
}

Tick Sight::tick(const Vec3& hip, double t) noexcept {
  auto [tick, can_move] = begin_tick(proxy_, frame_, hip, t);
  if (!can_move) return tick;

  timing_.tick(t);
  hand_velocity_.update(hip, t);
  Movement movement = move(hip, t);
  finish_movement(proxy_, movement);
  supervise(hip, t, movement);
  write_movement(proxy_, movement, mover_.patch(), frame_, parameters_.motion.max_extrapolation,
                 tick);
  if (tracker_.holding()) tick.flags |= surface_hidden;
  tick.force = blend_force(render_force(hip, t, tick.flags), hip, t);
  tick.surface_velocity = tracker_.tracking() ? tracker_.surface().normal_velocity() : 0.0;
  tick.surface_motion = surface_velocity(t);
  return tick;
}

}  // namespace palpate
