// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/teleop/set_point.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"

namespace palpate {
namespace {

constexpr double approach_time = 0.005;   // [s] in which a speed of the surface counts
constexpr double press_time = 0.1;        // [s] in which a wanted force is reached
constexpr double touching_force = 0.1;    // [N] who is to press with more is to touch
constexpr double clear_deviations = 2.0;  // [-] of the camera's noise that it stays farther away
constexpr double notice_time = 0.2;       // [s] after which a noisy image shows a motion turned
constexpr double farthest_clear = 0.02;   // [m] for noise and motion: 60 mm/s in lag and notice
constexpr double lately_time = 2.0;       // [s] after which a motion is nearly forgotten
constexpr double retreat_speed = 0.02;    // [m/s] for each N above that
constexpr double farthest_retreat = 0.1;  // [m]
constexpr double return_time = 1.0;       // [s] in which a retreat is taken back
constexpr double longest_forecast = 0.3;  // [s]
// [-] of the robot's lag by which a surface that comes is led before: 1 for a surface that
// continues as it does; half as much again as its speed is known late, and only about.
constexpr double ahead = 1.5;
constexpr double fastest_surface = 0.5;  // [m/s] that is led before
constexpr double turn_time = 0.2;        // [s] in which a normal that turned round is believed
constexpr double acceleration = 1.0;     // [m/s^2] of what is led, after a contact

// The share of the way to its goal that a first-order lag goes in dt.
double share_of(double dt, double time) { return 1.0 - std::exp(-dt / time); }

constexpr const char* in_a_surface =
    "the tool is in what the camera sees: move the arm until it is free";

Vec3 without_part_against(const Vec3& unit, const Vec3& v) {
  return v - std::min(v.dot(unit), 0.0) * unit;
}

}  // namespace

void validate(const SetPointOptions& options) {
  check_range("teleop", "tool_radius", "m", 1e-4, 0.05, options.tool_radius);
  check_range("teleop", "tool_reach", "m", 0.0, 5.0, options.tool_reach);
  check_range("teleop", "lever", "m", 0.01, 5.0, options.lever);
  check_range("teleop", "margin", "m", 0.0, 0.05, options.margin);
  check_range("teleop", "lag", "s", 0.0, 1.0, options.lag);
  if (options.stiffness) check_range("teleop", "stiffness", "N/m", 1.0, 1e6, *options.stiffness);
  check_range("teleop", "max_force", "N", 0.1, 1000.0, options.max_force);
  check_range("teleop", "unwanted_force", "N", 0.1, 1000.0, options.unwanted_force);
  check_range("teleop", "press_share", "-", 0.0, 1.0, options.press_share);
  check_range("teleop", "max_speed", "m/s", 1e-3, 5.0, options.max_speed);
  check_range("teleop", "contact_speed", "m/s", 1e-3, 5.0, options.contact_speed);
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

ServoTick with_proxy_at(const Vec3& tool, ServoTick tick, const Rotation& turn) {
  tick.place = tick.tick.proxy = tool;
  tick.tick.proxy_orientation = turn;
  tick.tick.state = ContactState::free_motion;
  tick.tick.normal = Vec3::Zero();
  tick.tick.surface_velocity = 0.0;
  return tick;
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
      options_.tool_radius + options_.margin + clear_ + speed * (age + ahead * options_.lag);
  return std::clamp(needed - gap, 0.0, farthest_retreat) * comes.away;
}

// The proxy goes away from what is touched as fast as that comes, and any other way only slowly, in
// contact and for a while after: one that a noisy image lets fall must not take the tool along.
// Nor does it go fast against what pushes the tool: what is touched from behind is none of its; nor
// along a normal that has just turned round, as it does where a proxy slips under a noisy surface.
void SetPoint::follow(const HandPose& held, bool touches, const Vec3& force, double dt) noexcept {
  const double fastest = options_.max_speed + fastest_surface;
  speed_ = touches ? options_.contact_speed : std::min(speed_ + acceleration * dt, fastest);
  const Vec3 way = held.position - held_.position;
  const bool believed = normal_.dot(force) >= -touching_force && normal_.dot(usual_) >= 0.0;
  const double along = believed ? std::max(way.dot(normal_), 0.0) : 0.0;
  const Vec3 outward = along * normal_;
  const Vec3 rest = way - outward;
  const Vec3 turn = rotation_vector(between(held.orientation, held_.orientation));
  const double swing = options_.lever * turn.norm();  // [m] of the farthest point
  const double far = rest.norm() + swing;
  double share = far > speed_ * dt ? speed_ * dt / far : 1.0;
  held_.position += outward + share * rest;
  // A proxy that is reset turns at once; a robot's hand keeps to its own speed.
  if (share * swing > options_.max_speed * dt) share = options_.max_speed * dt / swing;
  held_.orientation = unit(product(rotation_by(share * turn), held_.orientation));
}

// The normal of what is touched, and how that and what comes have moved lately.
void SetPoint::look(const Tick& tick, bool touches, const Approach& comes, double dt) noexcept {
  if (touches) normal_ = tick.normal.normalized();
  const bool goes_on = std::exchange(touched_, touches) && touches;
  usual_ += (goes_on ? share_of(dt, turn_time) : 1.0) * (normal_ - usual_);

  const double speed = touches ? std::clamp(tick.surface_velocity, 0.0, fastest_surface) : 0.0;
  approach_ += share_of(dt, approach_time) * (speed - approach_);

  // What has moved lately may turn and come before the tool is out of its way.
  const double moves = touches ? std::abs(tick.surface_velocity) : 0.0;
  const double kept = 1.0 - share_of(dt, lately_time);
  lately_ = std::max(std::min(std::max(moves, comes.speed), fastest_surface), kept * lately_);
  touched_lately_ = std::max(std::min(moves, fastest_surface), kept * touched_lately_);
  // What is said to come may be noise; a surface that was touched and moved may turn unnoticed.
  clear_ = std::min(
      clear_deviations * comes.noise + options_.lag * lately_ + notice_time * touched_lately_,
      farthest_clear);
}

// Into what is touched, or away from it by `clear_`. @return [N] with which it is to press
double SetPoint::press_by(const Vec3& press, bool touches, bool led, double dt) noexcept {
  double wanted = 0.0;
  double newtons = 0.0;
  double clear = touches ? clear_ : 0.0;
  if (touches && led && options_.stiffness) {
    newtons = std::clamp(-options_.press_share * press.dot(normal_), 0.0, options_.max_force);
    // Through the margin first, and then against the surface.
    const double through = std::min(newtons / touching_force, 1.0);
    wanted = options_.margin * through + newtons / *options_.stiffness;
    clear *= 1.0 - through;
  }
  depth_ += share_of(dt, press_time) * (wanted - clear - depth_);
  return newtons;
}

// From what pushes harder than the tool is to press.
void SetPoint::retreat(const Vec3& pushed, double newtons, double dt) noexcept {
  const double size = pushed.norm();
  const double above = size - std::min(newtons + options_.unwanted_force, options_.max_force);
  if (above > 0.0)
    retreat_ =
        no_longer_than(retreat_ + (retreat_speed * above * dt / size) * pushed, farthest_retreat);
  else
    retreat_ -= share_of(dt, return_time) * retreat_;
}

// Out of the way of what comes: farther at once; back, and to another side, slowly: where it comes
// from is a noisy guess.
void SetPoint::evade(Vec3 out, double dt) noexcept {
  const double far = out_.norm();
  if (far > 0.0) {
    const Vec3 unit = out_ / far;
    const double along = out.dot(unit);
    const Vec3 aside = out - along * unit;
    const double slowly = options_.contact_speed * dt;
    out = std::max(along, far - slowly) * unit + no_longer_than(aside, slowly);
    if (out.dot(unit) < 0.0) out.setZero();
  }
  out_ = out;
}

// Hazard: robot-collides, robot-presses, robot-struck
SetPoint::Order SetPoint::next(const ServoTick& record, const Vec3& press, bool led,
                               const Approach& comes, const Vec3& force) noexcept {
  const Tick& tick = record.tick;
  const double since = began_ ? tick.t - last_t_ : 0.0;
  const double dt = std::clamp(since, 0.0, 0.02);
  last_t_ = tick.t;
  const bool touches = tick.state != ContactState::free_motion && tick.normal.squaredNorm() > 0.25;
  look(tick, touches, comes, dt);
  const double newtons = press_by(press, touches, led, dt);
  const Vec3 pushed = force.allFinite() ? force : Vec3::Zero();
  retreat(pushed, newtons, dt);

  // A stop takes the set-point back to the tool at once; so does the beginning.
  const bool stops = std::exchange(led_, led) && !led;
  const bool at_once = !began_ || stops;
  const HandPose held{
      .position = record.place + (ahead * options_.lag * approach_ - depth_) * normal_,
      .orientation =
          is_rotation(tick.proxy_orientation) ? tick.proxy_orientation : held_.orientation};
  if (at_once)
    held_ = held;
  else
    follow(held, touches, pushed, dt);
  // The first place of all lies outside of all regions; what would be out of the way may not.
  Vec3 goal = held_.position;
  if (began_) {
    // Never into what is touched, by the image or by the robot's own force.
    Vec3 out = way_out(held_.position, comes, tick.t);
    if (touches) out = without_part_against(normal_, out);
    const double size = pushed.norm();
    if (size > touching_force) out = without_part_against(pushed / size, out);
    evade(out, dt);
    goal += out_ + retreat_;
  }
  goal += fixtures_
              .run({.t = tick.t,
                    .hip = goal,
                    .surface_force = Vec3::Zero(),
                    .surface_motion = Vec3::Zero(),
                    .hand = true,
                    .cloud = nullptr,
                    .new_frame = false})
              .displacement;
  const double step = (options_.max_speed + fastest_surface) * dt;
  Order order{.orientation = held_.orientation};
  order.position = at_once ? goal : Vec3(sent_ + no_longer_than(goal - sent_, step));
  if (!at_once && dt > 0.0) order.velocity = (order.position - sent_) / dt;
  sent_ = order.position;
  began_ = true;
  return order;
}

Outlook outlook(std::span<ApproachWatch> watches, const Vec3& proxy, const Vec3& tool,
                double radius, double now) noexcept {
  Outlook all;
  all.is_lost = !watches.empty();
  double noise = 0.0;
  for (ApproachWatch& watch : watches) {
    if (watch.newest().speed > all.comes.speed) all.comes = watch.newest();
    noise = std::max(noise, watch.newest().noise);
    all.clearance = std::min(all.clearance, watch.clearance());
    all.is_lost = all.is_lost && watch.is_between(proxy, tool, radius, now);
  }
  all.comes.noise = noise;
  return all;
}

// Hazard: robot-collides
const char* RobotStep::unguarded(const ServoTick& tick, const RobotState& at) const noexcept {
  const auto angle = [](const Rotation& a, const Rotation& b) {
    return rotation_vector(between(a, b)).norm();
  };
  constexpr double none = 1e-6;  // [rad]
  // A tool that begins inside a surface is moved by its hand alone, without a step.
  if (options_.tool_reach > 0.0 && tick.tick.steps == 0 && (tick.tick.flags & no_frame) == 0)
    return in_a_surface;
  if (!options_.turns && !(angle(tick.tick.proxy_orientation, tick.tick.orientation) < none))
    return "a tool with a shape needs a robot that turns: choose the ball";
  if (options_.turns && began_ && !(angle(at.orientation, ordered_) < most_behind))
    return "the arm does not turn as it is led: check its command topic, or leave out turns";
  return "";
}

SetPoint::Order RobotStep::next(ServoTick& tick, const Outlook& outlook, const Vec3& press,
                                RobotState& at, double now) noexcept {
  trouble_ = unguarded(tick, at);
  const bool is_lost = outlook.is_lost || *trouble_ != '\0';
  if (is_lost) tick = with_proxy_at(at.position, tick, at.orientation);
  const bool in_the_open = tick.tick.state == ContactState::free_motion;
  hand_.sees(tick.frame_age <= blind_after && !is_lost);
  const double clear = outlook.clearance - options_.tool_radius;
  const double way = (tick.place - at.position).norm();
  const double beyond = std::max(options_.tool_reach - options_.tool_radius, 0.0);
  hand_.clearance(in_the_open ? clear - beyond - way : 0.0);
  at.force = force_zero_.next(now, at.force, in_the_open && !is_lost && clear > ForceZero::clear);
  hand_.kept_out(tick.place - tick.tick.proxy);
  led_ = hand_.is_led() && !is_lost;
  // From the inside, what comes is on the wrong side.
  const Approach comes = trouble_ == in_a_surface ? Approach{} : outlook.comes;
  SetPoint::Order order = set_point_.next(tick, press, led_, comes, at.force);
  ordered_ = order.orientation;
  began_ = true;
  return order;
}

}  // namespace palpate
