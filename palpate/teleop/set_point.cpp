// SPDX-License-Identifier: Apache-2.0
#include "palpate/teleop/set_point.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

constexpr double approach_time = 0.005;   // [s] in which a speed of the surface counts
constexpr double press_time = 0.1;        // [s] in which a wanted force is reached
constexpr double touching_force = 0.1;    // [N] who is to press with more is to touch
constexpr double retreat_speed = 0.02;    // [m/s] for each N above what is allowed
constexpr double farthest_retreat = 0.1;  // [m]
constexpr double return_time = 1.0;       // [s] in which a retreat is taken back
constexpr double longest_forecast = 0.3;  // [s]
// [-] of the robot's lag by which a surface that comes is led before: 1 for a surface that goes on
// as it does; half as much again as its speed is known late, and only about.
constexpr double ahead = 1.5;
constexpr double fastest_surface = 0.5;  // [m/s] that is led before

// The share of the way to its goal that a first-order lag goes in dt.
double share_of(double dt, double time) {
  return 1.0 - std::exp(-dt / time);
}

Vec3 no_longer_than(const Vec3& v, double longest) {
  const double size = v.norm();
  return size > longest ? Vec3(longest / size * v) : v;
}

}  // namespace

void validate(const SetPointOptions& options) {
  const auto check = [](const char* name, double value, double least, double most,
                        const char* unit) {
    if (!(value >= least && value <= most))
      throw Error(std::string("teleop, ") + name,
                  number_text(value) + " " + unit + " is out of range",
                  "give " + number_text(least) + " to " + number_text(most) + " " + unit);
  };
  check("tool_radius", options.tool_radius, 1e-4, 0.05, "m");
  check("margin", options.margin, 0.0, 0.05, "m");
  check("lag", options.lag, 0.0, 1.0, "s");
  if (options.stiffness) check("stiffness", *options.stiffness, 1.0, 1e6, "N/m");
  check("max_force", options.max_force, 0.1, 1000.0, "N");
  check("press_share", options.press_share, 0.0, 1.0, "");
  check("max_speed", options.max_speed, 1e-3, 5.0, "m/s");
}

std::shared_ptr<const FixtureSet> robot_fixtures(const FixtureSet& fixtures) {
  constexpr double never = 1.0;  // [m] the most that a fixture takes
  std::vector<Fixture> regions;
  for (Fixture& fixture : fixtures.fixtures()) {
    if (fixture.kind != FixtureKind::forbidden || fixture.shape == FixtureShape::seen) continue;
    fixture.numbers.give_way = never;
    regions.push_back(std::move(fixture));
  }
  return std::make_shared<const FixtureSet>(regions);
}

SetPoint::SetPoint(const SetPointOptions& options) : options_(options) {
  validate(options);
  fixtures_.use(options_.fixtures.get());
}

// [m] from `place`, so that the tool is clear of what comes by the time that it can be out of the
// way.
Vec3 SetPoint::way_out(const Vec3& place, const Approach& comes, double t) const noexcept {
  const double age = t - comes.stamp;
  if (!(comes.speed > 0.0 && age >= 0.0 && age < longest_forecast)) return Vec3::Zero();
  const double speed = std::min(comes.speed, fastest_surface);
  const double gap = comes.gap + (place - comes.place).dot(comes.away);
  const double needed =
      options_.tool_radius + options_.margin + speed * (age + ahead * options_.lag);
  return std::clamp(needed - gap, 0.0, farthest_retreat) * comes.away;
}

SetPoint::Order SetPoint::next(const ServoTick& record, const Vec3& press, bool led,
                               const Approach& comes, const Vec3& force) noexcept {
  const Tick& tick = record.tick;
  const double since = began_ ? tick.t - last_t_ : 0.0;
  const double dt = std::clamp(since, 0.0, 0.02);
  last_t_ = tick.t;
  const bool touches = tick.state != ContactState::free_motion && tick.normal.squaredNorm() > 0.25;
  if (touches) normal_ = tick.normal.normalized();

  const double speed = touches ? std::clamp(tick.surface_velocity, 0.0, fastest_surface) : 0.0;
  approach_ += share_of(dt, approach_time) * (speed - approach_);

  double wanted = 0.0;
  if (touches && led && options_.stiffness) {
    const double newtons =
        std::clamp(-options_.press_share * press.dot(normal_), 0.0, options_.max_force);
    // Through the margin first, and then against the surface.
    wanted =
        options_.margin * std::min(newtons / touching_force, 1.0) + newtons / *options_.stiffness;
  }
  depth_ += share_of(dt, press_time) * (wanted - depth_);

  const double size = force.allFinite() ? force.norm() : 0.0;
  const double above = size - options_.max_force;
  if (above > 0.0)
    retreat_ =
        no_longer_than(retreat_ + (retreat_speed * above * dt / size) * force, farthest_retreat);
  else
    retreat_ -= share_of(dt, return_time) * retreat_;

  const Vec3 held = record.place + (ahead * options_.lag * approach_ - depth_) * normal_;
  // The first place of all lies outside of all regions; what would be out of the way may not.
  Vec3 goal = began_ ? Vec3(held + way_out(held, comes, tick.t) + retreat_) : held;
  goal += fixtures_
              .run({.t = tick.t,
                    .hip = goal,
                    .surface_force = Vec3::Zero(),
                    .surface_motion = Vec3::Zero(),
                    .hand = true,
                    .cloud = nullptr,
                    .new_frame = false})
              .displacement;
  // A stop takes the set-point back to the tool at once; so does the beginning.
  const bool stops = std::exchange(led_, led) && !led;
  const bool at_once = !began_ || stops;
  const Vec3 way = goal - sent_;
  const double step = (options_.max_speed + fastest_surface) * dt;
  const double distance = way.norm();
  Order order;
  order.position = at_once || distance <= step ? goal : Vec3(sent_ + step / distance * way);
  if (!at_once && dt > 0.0) order.velocity = (order.position - sent_) / dt;
  sent_ = order.position;
  began_ = true;
  return order;
}

}  // namespace palpate
