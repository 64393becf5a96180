// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/teleop/touched.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/kernel/core/linear.hpp"
#include "palpate/kernel/core/tick.hpp"

namespace palpate {
namespace {

constexpr double begins = 0.2;           // [N] along the normal: a touch begins
constexpr double ends = 0.1;             // [N] it ends
constexpr double least_peak = 0.5;       // [N] that stands out from a force sensor's noise
constexpr double absurd = 200.0;         // [N] no tool that is led presses with more
constexpr double least_time = 0.15;      // [s]
constexpr double least_depth = 5e-4;     // [m]
constexpr double widest = 5e-3;          // [m] that a press may move aside
constexpr double least_fit = 0.8;        // [-] share of the force's variance that is explained
constexpr double least_spring = 0.5;     // [-] share of the peak force that the spring makes
constexpr double most_left = 0.75;       // [-] of the depth when the force is gone
constexpr double slides = 5e-3;          // [m/s]
constexpr double least_slide = 0.01;     // [m]
constexpr double largest_scatter = 0.5;  // [-] of the drag, to its mean

}  // namespace

// Hazard: robot-lies
std::string_view disbelief(const Touched& touched) noexcept {
  const auto within = [](const std::optional<double>& value, double least, double most) {
    return !value || (*value >= least && *value <= most);  // no number is not
  };
  if (!is_place(touched.place)) return "position is not finite";
  if (!(std::abs(touched.normal.norm() - 1.0) < 0.01)) return "normal is not a unit vector";
  if (!within(touched.stiffness, Touched::softest, Touched::hardest))
    return "stiffness is out of range";
  if (!within(touched.friction, 0.0, Touched::most_friction))
    return "friction coefficient is out of range";
  if (!touched.stiffness && !touched.friction) return "contains neither stiffness nor friction";
  return {};
}

std::optional<Touched> TouchLearner::next(double t, const Vec3& tool, const Vec3& velocity,
                                          const Vec3& force, const Vec3& normal) noexcept {
  if (!is_place(tool) || !velocity.allFinite() || !force.allFinite() || !std::isfinite(t) ||
      force.norm() > absurd) {
    if (touching_)
      why_not_ = "the robot reported a force or a position that is not finite or out of range";
    touching_ = false;
    was_free_ = false;
    return std::nullopt;
  }
  if (!touching_) {
    was_free_ = was_free_ || force.norm() < ends;
    if (!was_free_ || !(normal.squaredNorm() > 0.25)) return std::nullopt;
    const Vec3 unit = normal.normalized();
    if (!(force.dot(unit) > begins)) return std::nullopt;
    touching_ = true;
    touch_ = {};
    touch_.began = touch_.last_t = t;
    touch_.start = touch_.last = touch_.at_peak = tool;
    touch_.normal = unit;
  }
  Touch& touch = touch_;
  const double push = force.dot(touch.normal);
  if (!(push > ends)) {
    touching_ = false;
    return taught();
  }
  const Vec3 way = tool - touch.start;
  const double depth = -way.dot(touch.normal);
  touch.aside = std::max(touch.aside, (way + depth * touch.normal).norm());
  touch.deepest = std::max(touch.deepest, depth);
  if (push > touch.peak) {
    touch.peak = push;
    touch.at_peak = tool;
  }
  const Vec3 terms(1.0, depth, -velocity.dot(touch.normal));
  touch.squares += terms * terms.transpose();
  touch.with_force += push * terms;
  touch.force_2 += push * push;
  touch.depth = depth;

  const double dt = t - touch.last_t;
  Vec3 step = tool - touch.last;
  step -= step.dot(touch.normal) * touch.normal;
  if (const double length = step.norm(); dt > 0.0 && length > slides * dt && push > begins) {
    const double drag = -force.dot(step) / (length * push);
    touch.slid += length;
    touch.drag += length * drag;
    touch.drag_2 += length * drag * drag;
  }
  touch.last = tool;
  touch.last_t = t;
  return std::nullopt;
}

std::optional<Touched> TouchLearner::taught() noexcept {
  const Touch& touch = touch_;
  Touched found;
  found.place = touch.at_peak - radius_ * touch.normal;
  found.normal = touch.normal;
  why_not_ = {};
  const double n = std::max(touch.squares(0, 0), 1.0);
  const double mean = touch.with_force[0] / n;
  const double variance = touch.force_2 / n - mean * mean;
  const Vec3 line = solve_symmetric<3>(touch.squares, touch.with_force);  // force at no depth, K, B
  // Of what the line leaves, by its normal equations.
  const double left = std::max(touch.force_2 - line.dot(touch.with_force), 0.0) / n;
  if (touch.last_t - touch.began < least_time)
    why_not_ = "it was too short";
  else if (touch.peak < least_peak)
    why_not_ = "it was too weak";
  else if (touch.aside > widest)
    why_not_ = "it slid";
  else if (touch.deepest < least_depth)
    found.stiffness = Touched::hardest;
  else if (!(line[1] * touch.deepest > least_spring * touch.peak &&
             left < (1.0 - least_fit) * variance && touch.depth < most_left * touch.deepest))
    why_not_ = "the contact is not elastic";
  else
    found.stiffness = std::clamp(line[1], Touched::softest, Touched::hardest);

  if (touch.slid >= least_slide) {
    const double drag = touch.drag / touch.slid;
    const double scatter = std::sqrt(std::max(touch.drag_2 / touch.slid - drag * drag, 0.0));
    if (drag > 0.0 && drag <= Touched::most_friction && scatter < largest_scatter * drag)
      found.friction = drag;
  }
  if (!found.stiffness && !found.friction) return std::nullopt;
  return found;
}

}  // namespace palpate
