// SPDX-License-Identifier: Apache-2.0
#include "lab/teleop_rig.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lab/closed_loop.hpp"
#include "palpate/io/devices/simulated_hand.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/net/teleop/set_point.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate::lab {
namespace {

constexpr double period = 1e-3;         // [s] of a tick
constexpr double robot_speed = 0.25;    // [m/s] the reduced speed of ISO 10218
constexpr double velocity_time = 5e-3;  // [s] of the filter behind an encoder's differences

class Coupling {
 public:
  Coupling() = default;
  virtual ~Coupling() = default;
  Coupling(const Coupling&) = delete;
  Coupling& operator=(const Coupling&) = delete;
  virtual void frame(const std::shared_ptr<const Cloud>& /*cloud*/, double /*stamp*/,
                     double /*t*/) {}  // not seen by all
  // The tool's place and forces, and the force that the hand feels.
  virtual void tick(double t, SimulatedTool& tool, TeleopTick& out) = 0;
};

// ---- Ours: the operator's surfaces are rendered here, the robot's are guarded there.
class Palpate final : public Coupling {
 public:
  Palpate(const TeleopCase& one, SimulatedHand& hand, const Vec3& begin, double latency)
      : one_(one),
        hand_(hand),
        sent_(begin),
        stopped_(begin),
        leads_(one.up, 2 * one.seed),
        frames_(one.down, 2 * one.seed + 1),
        led_(begin, LeadLimits{.max_speed = robot_speed}),
        operator_(make_method("sight", {one.parameters, nullptr}), hand,
                  operator_settings(one, latency), ring),
        guard_(make_method("sight", {guard_parameters(one), nullptr}), led_, guard_settings(one),
               ring),
        operator_ticks_(operator_.reader()),
        guard_ticks_(guard_.reader()),
        step_(led_, for_tool(one)) {}

  void frame(const std::shared_ptr<const Cloud>& cloud, double stamp, double t) override {
    guard_.put_frame(cloud, stamp, t);
    newest_ = {cloud, stamp};
    frames_.send({cloud, stamp}, t);
  }

  void tick(double t, SimulatedTool& tool, TeleopTick& out) override {
    if (t < one_.operator_dies)
      operator_end(t, out);
    else
      let_go(t);
    if (t < one_.robot_dies)
      sent_ = robot_end(t, tool);
    else if (t < one_.robot_dies + own_stop)
      stopped_ = tool.place();
    else
      sent_ = stopped_;
    tool.lead_to(sent_, t + period, period);
  }

 private:
  struct Seen {
    std::shared_ptr<const Cloud> cloud;
    double stamp = 0.0;  // [s]
  };
  static constexpr std::size_t ring = 4;   // read after each tick
  static constexpr double own_stop = 0.1;  // [s] without an order: a robot stops

  // As a watchdog does.
  void let_go(double t) {
    static_cast<void>(hand_.read(t));
    hand_.write(Vec3::Zero(), t);
  }

  void operator_end(double t, TeleopTick& out) {
    if (const auto seen = frames_.arrived(t)) operator_.put_frame(seen->cloud, seen->stamp, t);
    operator_.run({.t = t});
    ServoTick felt;
    static_cast<void>(operator_ticks_.try_pop(felt));
    out.force = felt.force;
    leads_.send(lead_of(felt), t);
  }

  Vec3 robot_end(double t, SimulatedTool& tool) {
    if (const std::optional<Lead> lead = leads_.arrived(t)) led_.lead(lead_ = *lead, t);
    led_.tool_is_at(tool.place());
    guard_.run({.t = t});
    ServoTick guarded;
    static_cast<void>(guard_ticks_.try_pop(guarded));
    const Outlook seen =
        outlook({&watch_, 1}, guarded.place, tool.place(), SimulatedTool::radius, t);
    RobotState at{
        .t = t, .position = tool.place(), .velocity = tool.velocity(), .force = tool.contact()};
    const SetPoint::Order order = step_.next(guarded, seen, lead_.press, at, t);
    if (newest_.cloud)
      watch_.frame(std::exchange(newest_.cloud, nullptr), newest_.stamp, tool.place());
    return order.position;
  }

  static ServoSettings operator_settings(const TeleopCase& one, double latency) {
    ServoSettings settings;
    settings.parameters = one.parameters;
    settings.fixtures = one.fixtures;
    settings.safety = for_link(settings.safety, latency);
    settings.safety.initial_heat = 0.0;
    return settings;
  }
  static Parameters guard_parameters(const TeleopCase& one) {
    Parameters parameters = one.parameters;
    set_parameter(parameters, "r_c", SimulatedTool::radius + SetPointOptions{}.margin);
    return parameters;
  }
  static SetPointOptions for_tool(const TeleopCase& one) {
    SetPointOptions options;
    if (one.fixtures) options.fixtures = robot_fixtures(*one.fixtures);
    options.tool_radius = SimulatedTool::radius;
    options.lag = SimulatedTool::lag();
    options.stiffness = SimulatedTool::stiffness();
    options.max_speed = robot_speed;
    return options;
  }
  static ServoSettings guard_settings(const TeleopCase& one) {
    ServoSettings settings;
    settings.parameters = guard_parameters(one);
    if (one.fixtures) settings.fixtures = robot_fixtures(*one.fixtures);
    return settings;
  }

  TeleopCase one_;
  SimulatedHand& hand_;
  Vec3 sent_, stopped_;
  Channel<Lead> leads_;
  Channel<Seen> frames_;
  LedHand led_;
  Lead lead_;
  Cycle operator_, guard_;
  TickRing<ServoTick>::Reader operator_ticks_, guard_ticks_;
  ApproachWatch watch_;
  RobotStep step_;
  Seen newest_;
};

// ---- What others do, without a camera: forces cross the link.
class ForceLink : public Coupling {
 public:
  ForceLink(SimulatedHand& hand, double peak) : hand_(hand), peak_(peak) {}

 protected:
  Vec3 read(double t) {
    Vec3 place = hand_.read(t).position;
    if (last_)
      velocity_ +=
          (1.0 - std::exp(-period / velocity_time)) * ((place - *last_) / period - velocity_);
    last_ = place;
    return place;
  }
  void write(const Vec3& force, double t, TeleopTick& out) {
    out.force = no_longer_than(force, peak_);
    hand_.write(out.force, t);
  }
  Vec3 velocity_ = Vec3::Zero();  // [m/s] of the hand

 private:
  SimulatedHand& hand_;
  double peak_;  // [N]
  std::optional<Vec3> last_;
};

// The robot follows the hand; what the robot feels comes back.
class PositionForce final : public ForceLink {
 public:
  PositionForce(const TeleopCase& one, SimulatedHand& hand, double peak)
      : ForceLink(hand, peak), places_(one.up, 2 * one.seed), forces_(one.down, 2 * one.seed + 1) {}

  void tick(double t, SimulatedTool& tool, TeleopTick& out) override {
    const Vec3 place = read(t);
    write(force_, t, out);
    places_.send(place, t);
    if (const auto arrived = places_.arrived(t)) place_ = *arrived;
    if (place_) tool.lead_to(*place_, t + period, period);
    forces_.send(tool.contact(), t);
    if (const auto arrived = forces_.arrived(t)) force_ = *arrived;
  }

 private:
  Channel<Vec3> places_, forces_;
  std::optional<Vec3> place_;
  Vec3 force_ = Vec3::Zero();
};

// Wave variables (Niemeyer and Slotine 1991), with the robot's loop on the wave's velocity.
class Wave final : public ForceLink {
 public:
  Wave(const TeleopCase& one, SimulatedHand& hand, double peak)
      : ForceLink(hand, peak), out_(one.up, 2 * one.seed), back_(one.down, 2 * one.seed + 1) {}

  void tick(double t, SimulatedTool& tool, TeleopTick& out) override {
    const double root = std::sqrt(2.0 * impedance);
    const Vec3 place = read(t);
    if (!led_to_) led_to_ = place;
    if (const auto arrived = back_.arrived(t)) returned_ = *arrived;
    // Force of the hand on the line; what the hand feels is its reaction.
    const Vec3 by_hand = impedance * velocity_ - root * returned_;
    write(-by_hand, t, out);
    // The place goes along, so that what a loss takes away does not add up.
    out_.send({root * velocity_ - returned_, place}, t);

    if (const auto arrived = out_.arrived(t)) sent_ = *arrived;
    // The line's end and the robot's loop at once: root u = b v + K e + B (v - v_tool).
    const Vec3 spring = SimulatedTool::stiffness() * (*led_to_ - tool.place());
    led_at_ = (root * sent_.wave - spring + SimulatedTool::damping() * tool.velocity()) /
              (impedance + SimulatedTool::damping());
    const Vec3 pull = spring + SimulatedTool::damping() * (led_at_ - tool.velocity());
    *led_to_ += period * led_at_;
    if (sent_.place) *led_to_ += (1.0 - std::exp(-period / drift_time)) * (*sent_.place - *led_to_);
    tool.push(pull, t + period, period);
    back_.send((impedance * led_at_ - pull) / root, t);
  }

 private:
  static constexpr double impedance = 10.0;  // [N s/m]
  static constexpr double drift_time = 1.0;  // [s]
  struct Sent {
    Vec3 wave = Vec3::Zero();
    std::optional<Vec3> place = {};
  };
  Channel<Sent> out_;
  Channel<Vec3> back_;
  Sent sent_;
  Vec3 returned_ = Vec3::Zero();
  std::optional<Vec3> led_to_;
  Vec3 led_at_ = Vec3::Zero();
};

// Time-domain passivity of a link with delay (Ryu, Artigas and Preusche 2010): each end may give
// out no more than what is known to have gone in at the other.
class Tdpa final : public ForceLink {
 public:
  Tdpa(const TeleopCase& one, SimulatedHand& hand, double peak)
      : ForceLink(hand, peak), out_(one.up, 2 * one.seed), back_(one.down, 2 * one.seed + 1) {}

  void tick(double t, SimulatedTool& tool, TeleopTick& out) override {
    const Vec3 place = read(t);
    if (const auto arrived = back_.arrived(t)) returned_ = *arrived;
    // At the hand: force from afar, damped where it gives out more than went in there.
    Vec3 force = returned_.force;
    const double speed_2 = velocity_.squaredNorm();
    const double due = given_here_ + period * force.dot(velocity_) - returned_.energy;
    if (due > 0.0 && speed_2 > slow * slow)
      force -= std::min(due / (period * speed_2), most_damping) * velocity_;
    const double power = force.dot(velocity_);
    (power < 0.0 ? taken_here_ : given_here_) += period * std::abs(power);
    write(force, t, out);
    out_.send({place, velocity_, taken_here_}, t);

    if (const auto arrived = out_.arrived(t)) sent_ = *arrived;
    if (!sent_) return;
    if (!led_to_) led_to_ = sent_->place;
    const Vec3 pull = SimulatedTool::stiffness() * (*led_to_ - tool.place()) -
                      SimulatedTool::damping() * tool.velocity();
    // At the robot: the velocity from afar, less where it gives out more than went in here.
    const Vec3 behind = (sent_->place - *led_to_) / catch_up;
    Vec3 velocity = sent_->velocity + no_longer_than(behind, robot_speed);
    const double pull_2 = pull.squaredNorm();
    const double over = given_there_ + period * pull.dot(velocity) - sent_->energy;
    if (over > 0.0 && pull_2 > weak * weak) velocity -= over / (period * pull_2) * pull;
    velocity = no_longer_than(velocity, robot_speed);
    const double out_there = pull.dot(velocity);
    (out_there > 0.0 ? given_there_ : taken_there_) += period * std::abs(out_there);
    *led_to_ += period * velocity;
    tool.push(pull, t + period, period);
    back_.send({tool.contact(), taken_there_}, t);
  }

 private:
  static constexpr double slow = 1e-3;         // [m/s] the hand rests
  static constexpr double weak = 1e-2;         // [N]
  static constexpr double most_damping = 8.0;  // [N s/m] a Touch bears no more
  static constexpr double catch_up = 0.5;      // [s] in which the robot makes up what it lost
  struct Sent {
    Vec3 place, velocity;
    double energy;  // [J] that has gone in
  };
  struct Returned {
    Vec3 force = Vec3::Zero();
    double energy = 0.0;  // [J]
  };
  Channel<Sent> out_;
  Channel<Returned> back_;
  std::optional<Sent> sent_;
  Returned returned_;
  std::optional<Vec3> led_to_;
  double given_here_ = 0.0, taken_here_ = 0.0, given_there_ = 0.0, taken_there_ = 0.0;
};

std::unique_ptr<Coupling> make_coupling(const TeleopCase& one, SimulatedHand& hand, double peak,
                                        const Vec3& begin, double latency) {
  if (one.way == "palpate") return std::make_unique<Palpate>(one, hand, begin, latency);
  if (one.way == "position-force") return std::make_unique<PositionForce>(one, hand, peak);
  if (one.way == "wave") return std::make_unique<Wave>(one, hand, peak);
  if (one.way == "tdpa") return std::make_unique<Tdpa>(one, hand, peak);
  throw Error("teleop", "there is no coupling '" + std::string(one.way) + "'",
              "there are palpate, position-force, wave and tdpa");
}

}  // namespace

void play_teleop(const TeleopScene& scene, const TeleopCase& one,
                 const std::function<void(const TeleopTick&)>& on_tick) {
  const DevicePreset& device = device_preset("touch");
  const Grip& grip = grip_preset("light");
  const auto held = simulated_hand(scene.hand, grip, device, one.seed);
  SimulatedHand& hand = *held;
  const Vec3 begin = scene.hand.at(scene.hand.first_time());
  SimulatedTool tool(begin, [&scene](const Vec3& place, double t) -> SimulatedTool::Surface {
    const TruePoint at = scene.truth(place, t);
    return {at.distance, at.normal};
  });
  const double latency = scene.camera_latency + one.down.delay;
  const auto coupling = make_coupling(one, hand, device.limits.max_force, begin, latency);
  std::uint64_t next_frame = 0;
  const auto ticks = static_cast<std::int64_t>(std::llround(scene.duration / period));
  for (std::int64_t i = 0; i <= ticks; ++i) {
    TeleopTick out;
    out.t = static_cast<double>(i) * period;
    for (;; ++next_frame) {
      const double stamp = static_cast<double>(next_frame) / scene.frame_rate;
      if (stamp + scene.camera_latency > out.t + 1e-9) break;
      if (stamp >= scene.dark_from && stamp < scene.dark_until) continue;
      coupling->frame(scene.cloud(next_frame, stamp), stamp, out.t);
    }
    coupling->tick(out.t, tool, out);
    const HandStatistics& statistics = hand.statistics();
    out.hand_speed = std::sqrt(2.0 * statistics.kinetic / (grip.mass + device.body.mass));
    out.shake = statistics.shake;
    out.work = statistics.work;
    out.tool = tool.place();
    out.tool_velocity = tool.velocity();
    out.depth = tool.depth();
    out.contact = tool.contact().norm();
    on_tick(out);
  }
}

}  // namespace palpate::lab
