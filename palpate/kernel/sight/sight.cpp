// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/sight.hpp"

#include <algorithm>
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
    : parameters_(parameters), contact_(mover_options(parameters)) {
  validate(parameters);
  set_parameters(parameters);
}

void Sight::set_parameters(const Parameters& parameters) noexcept {
  parameters_ = parameters;
  contact_.mover.set(mover_options(parameters));
  contact_.tracker.set(parameters.sight);
  contact_.monitor.set(parameters);
  timing_.set(parameters.sight.oldest_frame);
}

void Sight::seat(const Vec3& proxy) noexcept {
  if (!is_place(proxy)) return;
  contact_.proxy = {};
  contact_.proxy.at = proxy;
  hand_velocity_.reset();
  contact_.mover.seat();
  contact_.tracker.note(Evidence::lost);
  contact_.tracker.note(Evidence::left);
  for (FusedImage& each : contact_.fused) each.forget();
  contact_.monitor.forget();
  contact_.last_proxy.reset();
  contact_.points_moved = Vec3::Zero();
  contact_.renderer.forget();
}

// [s] between the newest two frames of the newest one's camera; the nominal one where their stamps
// do not increase.
double Sight::interval() const noexcept {
  return frame_.in_order() ? frame_.camera_interval() : 1.0 / parameters_.motion.frame_rate;
}

// The averaged points that the proxy rests on; null if it rests on a fit, or none are.
const FusedImage* Sight::fused() const noexcept {
  const SightTracker& tracker = contact_.tracker;
  const std::size_t camera = tracker.surface().camera();
  const bool is_fitted = touches(mode()) ? rests_on_fit(mode()) : tracker.smooth();
  if (is_fitted || !tracker.tracking() || camera >= most_fused) return nullptr;
  return contact_.fused[camera].active() ? &contact_.fused[camera] : nullptr;
}

// What each camera saw last, averaged where it is.
ObservedClouds Sight::points() const noexcept {
  ObservedClouds points = *frame_.cloud();
  for (std::size_t i = 0; i < most_fused; ++i)
    if (contact_.fused[i].active()) points.take(i, contact_.fused[i]);
  return points;
}

// How far what the proxy rests on has moved at time t [s] since its frame [m, world].
Vec3 Sight::displacement(double t) const noexcept {
  if (const FusedImage* points = fused()) return points->displacement(t);
  const SightTracker& tracker = contact_.tracker;
  return tracker.tracking() ? tracker.displacement(t) : Vec3(Vec3::Zero());
}

// [m/s, world] of that, as it is rendered at time t [s].
Vec3 Sight::surface_velocity(double t) const noexcept {
  const double dt = contact_.tracker.surface().interval() / 32.0;  // [s] a small part of it
  return (displacement(t) - displacement(t - dt)) / dt;
}

// [frames] A fit may describe what is none by chance: after so many on it points are forgotten.
constexpr int most_frames_on_fit = 8;
// A proxy does not touch the bottom of a trough much narrower than itself, but its flanks.
constexpr double narrowest_trough = 0.7;  // [-] r_c times curvature

// Averages the newest frame's points into those of its camera while the proxy rests on them, or
// would where it is about to touch.
void Sight::fuse(const Observation& seen, SightTracker::Event event) noexcept {
  if (seen.camera >= most_fused) return;
  FusedImage& fused = contact_.fused[seen.camera];
  const DepthImage* image = seen.cloud.image();
  const SurfaceEstimate& surface = contact_.tracker.surface();
  const Proxy& proxy = contact_.proxy;
  const bool touching = touches(mode()) && proxy.normal;
  // The fit of a concave corner may become one that no proxy rests on in any frame.
  const bool is_trough =
      surface.surface().strongest_rise() * parameters_.proxy.r_c() > 0.5 * narrowest_trough;
  const bool is_fitted = !is_trough && (rests_on_fit(mode()) || (!touching && surface.smooth()));
  contact_.frames_on_fit = is_fitted ? contact_.frames_on_fit + 1 : 0;
  if (image == nullptr || event != SightTracker::Event::followed ||
      contact_.frames_on_fit > most_frames_on_fit) {
    fused.forget();
    return;
  }
  fused.observe(*image,
                {.place = touching ? Vec3(*proxy.at - parameters_.proxy.r_c() * *proxy.normal)
                                   : surface.place(),
                 .radius = surface.resolution(),
                 .stamp = frame_.camera_stamp(),
                 .interval = interval(),
                 .sd = surface.beam_sd()},
                parameters_.sight);
}

// Side repair: the proxy was on the surface's free side and must be there still. If it will move
// over points, it must be in front of this frame's points, not only of their average.
void Sight::repair_side(const Vec3& points_moved) noexcept {
  Vec3& proxy = *contact_.proxy.at;
  const SightTracker& tracker = contact_.tracker;
  const bool touching = touches(mode());
  if (const FusedImage* points = touching ? fused() : nullptr) {
    proxy += points->correction() - points_moved;
    if (points->is_in_front(proxy)) return;
  }
  const SurfaceContact contact = tracker.contact(proxy, frame_.stamp());
  const double r_c = parameters_.proxy.r_c();
  const double least = touching && !tracker.smooth() ? r_c + tracker.surface().clearance() : r_c;
  if (contact.distance < least) proxy = contact.foot + least * contact.normal;
}

// A frame seen along the lines of sight: docs/sight.md, 3.
void Sight::observe(const Observation& seen) noexcept {
  using Event = SightTracker::Event;
  if (seen.camera >= Patch::max_views) return;
  const Cloud* previous = frame_.cloud() != nullptr ? frame_.cloud()->of(seen.camera) : nullptr;
  frame_.take(seen, 1.0 / parameters_.motion.frame_rate);
  timing_.frame(frame_.stamp(),
                frame_.in_order() && frame_.count() > 1 ? frame_.camera_interval() : 0.0);
  contact_.mover.invalidate();
  // The surface's own velocity, by which the force would go on changing without this frame.
  contact_.renderer.start_frame(surface_velocity(hand_velocity_.t()));
  contact_.monitor.start_frame(seen.camera);
  const Vec3 points_moved = std::exchange(contact_.points_moved, Vec3::Zero());
  if (!contact_.proxy.at) {
    fuse(seen, Event::none);
    return;
  }
  const Vec3& proxy = *contact_.proxy.at;
  SightTracker& tracker = contact_.tracker;
  // A hidden surface is kept only while the proxy is near it.
  constexpr double leaves = 4.0;  // [detail]
  if (tracker.holding() && !rests_on_fit(mode()) &&
      tracker.contact(proxy, frame_.stamp()).distance >
          parameters_.proxy.r_c() + leaves * parameters_.sight.detail) {
    tracker.note(Evidence::lost);
  }
  constexpr double infinite = std::numeric_limits<double>::infinity();
  const Event event = tracker.frame(*frame_.cloud(), previous, seen.camera, frame_.camera_stamp(),
                                    interval(), contact_.renderer.hip(), proxy,
                                    touches(mode()) ? parameters_.sight.hardest_strike : infinite);
  fuse(seen, event);
  if (event == Event::followed || event == Event::jumped) repair_side(points_moved);
}

// Is a place as near to the fit as the points' noise can stop a proxy?
bool Sight::is_near_fit(const Vec3& place, double t) const noexcept {
  constexpr double near = 2.0;  // [detail]
  const SightTracker& tracker = contact_.tracker;
  return tracker.contact(place, t).distance <= parameters_.proxy.r_c() +
                                                   near * parameters_.sight.detail +
                                                   4.0 * tracker.surface().spread();
}

// Rests the proxy on the fit, or frees it from there. False if the fit does not say where it is.
bool Sight::rest_on_fit(const Vec3& hip, double t, Movement& movement) noexcept {
  constexpr int most_slides = 6;
  // Hysteresis, so that the way to rest does not change from tick to tick.
  const double narrowest = (rests_on_fit(mode()) ? 1.0 : 0.7) * narrowest_trough;
  const double r_c = parameters_.proxy.r_c();
  SightTracker& tracker = contact_.tracker;
  for (int slides = 0; tracker.smooth();) {
    const SurfaceContact contact = tracker.contact(hip, t);
    if (!is_near_fit(hip, t) || contact.curvature * r_c > narrowest ||
        !tracker.faces(contact.normal))
      return false;
    if (contact.at_limit && !tracker.holding()) {
      if (slides == most_slides) movement.flags |= step_budget_hit;
      const Vec3 velocity = surface_velocity(hand_velocity_.t());
      if (slides++ < most_slides && tracker.slide(*frame_.cloud(), contact.foot)) {
        // The force goes on smoothly from one fit to the next, as from frame to frame.
        if (rests_on_fit(mode())) contact_.renderer.correct(velocity);
        continue;
      }
      if (!tracker.smooth()) return false;
    }
    ++movement.steps;
    movement.normal = contact.normal;
    if (contact.distance >= r_c) {
      if (tracker.holding()) return false;  // free of the hidden surface: move over the points
      contact_.proxy.at = hip;
      movement.state = ContactState::free_motion;
    } else {
      contact_.proxy.at = contact.foot + r_c * contact.normal;
      movement.state = ContactState::contact;
      movement.touched = true;
      contact_.proxy.normal = contact.normal;
    }
    return true;
  }
  return false;
}

// Between frames the points move with the surface that was fitted to them, and so does a proxy that
// touches them.
void Sight::move_over_points(const Vec3& hip, double t, Movement& movement) noexcept {
  SightTracker& tracker = contact_.tracker;
  Proxy& proxy = contact_.proxy;
  const double r_c = parameters_.proxy.r_c();
  const int steps = movement.steps;
  const bool moves = fused() != nullptr || (tracker.tracking() && tracker.surface().smooth());
  const Vec3 moved = moves ? displacement(t) : Vec3(Vec3::Zero());
  *proxy.at -= contact_.points_moved;
  const Vec3 before = *proxy.at;
  movement = contact_.mover.move(proxy, points(), hip - moved);
  movement.steps += steps;
  // Scattered points can let the proxy through; the line of sight through it shows that.
  if (const std::optional<Vec3> front = tracker.in_front(*frame_.cloud(), before, *proxy.at, r_c)) {
    movement.state = ContactState::contact;
    movement.normal = (*front - *proxy.at).normalized();
    movement.touched = true;
    proxy.normal = movement.normal;
    proxy.at = front;
  }
  if (movement.touched && proxy.normal)
    tracker.touch(*frame_.cloud(), *proxy.at - r_c * *proxy.normal, *proxy.normal);
  *proxy.at += moved;
  contact_.points_moved = moved;
}

// Movement on the fitted surface where it describes the points well, on the points elsewhere.
Movement Sight::move(const Vec3& hip, double t) noexcept {
  SightTracker& tracker = contact_.tracker;
  Proxy& proxy = contact_.proxy;
  if (!touches(mode())) tracker.watch(*frame_.cloud(), *proxy.at);
  Movement movement;
  const bool close = rests_on_fit(mode()) || (tracker.smooth() && is_near_fit(*proxy.at, t));
  bool on_fit = close && rest_on_fit(hip, t, movement);
  if (on_fit) {
    contact_.mover.invalidate();
    contact_.points_moved = tracker.displacement(t);
  } else {
    tracker.note(Evidence::on_points);
    move_over_points(hip, t, movement);
    on_fit = movement.touched && proxy.normal && rest_on_fit(hip, t, movement);
  }
  finish_movement(proxy, movement);
  tracker.note(!proxy.touching ? Evidence::left : on_fit ? Evidence::on_fit : Evidence::on_points);
  return movement;
}

// Puts the proxy at a place, where it touches nothing.
void Sight::put(const Vec3& place, Movement& movement) noexcept {
  contact_.tracker.note(Evidence::lost);
  contact_.tracker.note(Evidence::left);
  contact_.mover.invalidate();
  contact_.proxy = {};
  contact_.proxy.at = place;
  contact_.points_moved = Vec3::Zero();
  movement.state = ContactState::free_motion;
  movement.normal = Vec3::Zero();
}

// Puts the proxy at the hand, without a force.
void Sight::release(const Vec3& hip, Movement& movement) noexcept {
  put(hip, movement);
  contact_.renderer.release();
}

// What the newest frame itself shows overrules every estimate: docs/sight.md, 7. Was the proxy put
// back in front, and not in the frame before?
bool Sight::supervise(const Vec3& hip, double t, Movement& movement) noexcept {
  // [detail] A frame's correction moves a proxy no farther than a surface is looked for.
  constexpr double farthest_move = 60.0;
  Proxy& proxy = contact_.proxy;
  SightTracker& tracker = contact_.tracker;
  const double r_c = parameters_.proxy.r_c();
  if (contact_.last_proxy &&
      (*proxy.at - hip).norm() >
          (*contact_.last_proxy - hip).norm() + farthest_move * parameters_.sight.detail) {
    release(hip, movement);
    movement.flags |= proxy_let_go;
  }
  const Coupling& coupling = parameters_.coupling;
  const double deepest = r_c + std::min(coupling.max_force / std::max(coupling.stiffness, 1e-9),
                                        farthest_strike * parameters_.sight.detail);
  const Monitor::Verdict verdict = contact_.monitor.judge(
      *frame_.cloud(), {.hip = hip,
                        .proxy = *proxy.at,
                        .normal = proxy.normal.value_or(Vec3::Zero()),
                        .touching = touches(mode()) || !contact_.renderer.last().isZero(),
                        .carried = displacement(t),
                        .noise = tracker.surface().beam_sd(),
                        .deepest = deepest});
  if (verdict.behind) movement.flags |= pop_through_suspected;
  contact_.mover.set_hidden(verdict.hidden);
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
      put(verdict.front, movement);
      tracker.watch(*frame_.cloud(), verdict.front);
      tracker.note(Evidence::on_points);
      proxy.touching = true;
      proxy.normal = movement.normal = verdict.normal;
      movement.state = ContactState::contact;
      movement.flags |= returned_to_front;
      break;
  }
  contact_.last_proxy = proxy.at;
  return verdict.action == Monitor::Action::return_to_front && !verdict.again;
}

// Section 4.6, from the proxy where it will be on the moving surface. The damper acts on the hand's
// velocity relative to the surface. The rate of the distance, as in the paper, would also contain
// every correction of the estimate, and damp noise.
Vec3 Sight::render_force(const Vec3& hip, double t, std::uint32_t& flags) noexcept {
  if (!touches(mode())) return Vec3::Zero();
  Vec3 u = hip - *contact_.proxy.at;
  // A proxy that rests on points is moved with the surface for the force.
  if (contact_.tracker.tracking()) u -= displacement(t) - contact_.points_moved;
  const Vec3 relative = hand_velocity_.value() - surface_velocity(t);
  const double distance = u.norm();
  const double rate = distance > 0.0 ? relative.dot(u) / distance : 0.0;
  const CouplingForce result =
      coupling_force(parameters_.coupling, u, rate, parameters_.proxy.r_c(), false);
  if (result.saturated) flags |= force_saturated;
  return result.force;
}

// [-] 0 to 1: how well the surface is known. It fades while it is hidden, and while no frame comes.
double Sight::knowledge(double t) const noexcept {
  const SightParameters& sight = parameters_.sight;
  const SightTracker& tracker = contact_.tracker;
  double known = 1.0;
  if (tracker.holding())
    known = ease((t - tracker.held_since() - sight.hidden_hold) / sight.hidden_fade);
  // A single frame is a scan, not a stream that stopped. One lost frame is no reason to fade, nor
  // is one before it that was late by half an interval.
  const double fade = std::max(parameters_.motion.max_extrapolation, 1e-3);
  const double late = std::max(fade, 2.5 * timing_.interval());
  if (frame_.count() > 1) known *= ease((timing_.age(t) - late) / fade);
  return known;
}

Tick Sight::tick(const Vec3& hip, double t) noexcept {
  auto [tick, can_move] = begin_tick(contact_.proxy, frame_, hip, t);
  if (!can_move) return tick;

  timing_.tick(t);
  hand_velocity_.update(hip, t);
  Movement movement = move(hip, t);
  const bool returned = supervise(hip, t, movement);
  write_movement(contact_.proxy, movement, contact_.mover.patch(), frame_,
                 parameters_.motion.max_extrapolation, tick);
  const SightTracker& tracker = contact_.tracker;
  if (tracker.holding()) tick.flags |= surface_hidden;
  tick.force = contact_.renderer.render({.hip = hip,
                                         .t = t,
                                         .force = render_force(hip, t, tick.flags),
                                         .normal = contact_.proxy.normal,
                                         .velocity = surface_velocity(t),
                                         .blend = parameters_.sight.blend * interval(),
                                         .known = knowledge(t),
                                         .returned = returned,
                                         .return_speed = parameters_.sight.return_speed,
                                         .r_c = parameters_.proxy.r_c()},
                                        parameters_.coupling);
  if (tracker.tracking()) {
    const SurfaceEstimate& surface = tracker.surface();
    tick.surface_velocity = surface.normal_velocity();
    tick.surface_motion =
        along(surface_velocity(t), tick.normal.isZero() ? surface.normal() : tick.normal);
  }
  return tick;
}

}  // namespace palpate
