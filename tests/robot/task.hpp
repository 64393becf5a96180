// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "palpate/kernel/methods/methods.hpp"
#include "palpate/net/telelink/touched_paint.hpp"
#include "palpate/net/teleop/approach_watch.hpp"
#include "palpate/net/teleop/led_hand.hpp"
#include "palpate/net/teleop/set_point.hpp"
#include "palpate/net/teleop/touched.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/session/paint.hpp"

#include "robot/simulated_cell.hpp"

namespace palpate::robot {

inline constexpr double tick = 1e-3;            // [s]
inline constexpr double camera_latency = 0.03;  // [s]

inline const std::string exact = "&quantisation=0.05mm";  // options of a camera

// What is under way over a link, in order.
template <class T>
class Delayed {
 public:
  explicit Delayed(double delay) : delay_(delay) {}
  void send(T value, double t) { under_way_.emplace_back(t + delay_, std::move(value)); }
  std::optional<T> arrived(double t) {
    std::optional<T> newest;
    for (; !under_way_.empty() && under_way_.front().first <= t; under_way_.pop_front())
      newest = std::move(under_way_.front().second);
    return newest;
  }

 private:
  double delay_;  // [s]
  std::deque<std::pair<double, T>> under_way_;
};

struct Seen {
  std::shared_ptr<const Cloud> cloud;
  double stamp;  // [s]
};

// A hand, the link, and the simulated arm at its other end. Stepped, the same every time.
class Task {
 public:
  // @param hand   must outlive this
  // @param delay  [s] of the link, one way
  Task(const std::string& options, Device& hand, double delay, SetPointOptions wanted = {})
      : cell_(Uri("mujoco:desk?size=320x240" + options), Pace::stepped),
        camera_(cell_.camera()),
        operator_(make_method("sight"), hand, operator_settings(delay), 4),
        led_(cell_.simulation()->truth().tip),
        guard_(make_method("sight"), led_, guard_settings(wanted), 4),
        felt_(operator_.reader()),
        guarded_(guard_.reader()),
        set_point_(set_point(wanted)),
        leads_(delay),
        to_guard_(camera_latency),
        to_operator_(camera_latency + delay),
        learner_(cell_.simulation()->info().tool_radius),
        found_(delay) {}

  Simulation& simulation() { return *cell_.simulation(); }
  // What the operator was last told of what the tool touched, and why it was ignored.
  [[nodiscard]] const std::optional<Touched>& touched() const { return touched_; }
  [[nodiscard]] const std::string& ignored() const { return ignored_; }
  [[nodiscard]] std::string_view why_not() const { return learner_.why_not(); }

  void run(double seconds, const std::function<void(const ServoTick& felt)>& look = {}) {
    for (const double end = t_ + seconds; t_ < end; t_ += tick) {
      simulation().advance(t_);
      if (t_ + 1e-9 >= static_cast<double>(frames_) / 30.0) {
        const Frame frame = *camera_->next();
        ++frames_;
        to_guard_.send({frame.cloud, frame.stamp}, t_);
        to_operator_.send({frame.cloud, frame.stamp}, t_);
      }
      if (const auto found = found_.arrived(t_)) {
        touched_ = found;
        ignored_ = paint_touched(paint_, {}, *found);
      }
      if (const auto seen = to_operator_.arrived(t_))
        operator_.put_frame(paint_.on(seen->cloud, 0), seen->stamp, t_);
      operator_.run({.t = t_});
      ServoTick felt;
      static_cast<void>(felt_.try_pop(felt));
      leads_.send(lead_of(felt), t_);
      robot_end();
      if (look) look(felt);
    }
  }

 private:
  static ServoSettings operator_settings(double delay) {
    ServoSettings settings;
    settings.safety = for_link(settings.safety, camera_latency + delay);
    settings.safety.initial_heat = 0.0;
    return settings;
  }
  ServoSettings guard_settings(const SetPointOptions& wanted) {
    ServoSettings settings;
    set_parameter(settings.parameters, "r_c",
                  cell_.simulation()->info().tool_radius + wanted.margin);
    return settings;
  }
  SetPointOptions set_point(SetPointOptions wanted) {
    const RobotInfo& info = cell_.simulation()->info();
    wanted.tool_radius = info.tool_radius;
    wanted.lag = info.lag;
    wanted.stiffness = info.stiffness;
    wanted.max_force = 5.0;
    return wanted;
  }

  void robot_end() {
    if (const auto lead = leads_.arrived(t_)) led_.lead(lead_ = *lead, t_);
    const RobotState state = simulation().state();
    led_.tool_is_at(state.position);
    if (auto seen = to_guard_.arrived(t_)) {
      guard_.put_frame(seen->cloud, seen->stamp, t_);
      watch_.frame(std::move(seen->cloud), seen->stamp, state.position);
    }
    guard_.run({.t = t_});
    ServoTick guarded;
    static_cast<void>(guarded_.try_pop(guarded));
    const bool lost =
        watch_.is_between(guarded.place, state.position, simulation().info().tool_radius, t_);
    if (lost) guarded = with_proxy_at(state.position, guarded);
    led_.sees(!lost);
    led_.clearance(guarded.tick.state == ContactState::free_motion
                       ? watch_.clearance() - simulation().info().tool_radius
                       : 0.0);
    if (const auto found =
            learner_.next(t_, state.position, state.velocity, state.force, guarded.tick.normal))
      found_.send(*found, t_);
    led_.kept_out(guarded.place - guarded.tick.proxy);
    const SetPoint::Order order =
        set_point_.next(guarded, lead_.press, led_.is_led() && !lost, watch_.newest(), state.force);
    simulation().command({order.position, order.orientation}, order.velocity);
  }

  SimulatedCell cell_;
  std::unique_ptr<Source> camera_;
  Cycle operator_;
  LedHand led_;
  Cycle guard_;
  TickRing<ServoTick>::Reader felt_, guarded_;
  ApproachWatch watch_;
  SetPoint set_point_;
  Delayed<Lead> leads_;
  Delayed<Seen> to_guard_, to_operator_;
  TouchLearner learner_;
  Delayed<Touched> found_;
  std::optional<Touched> touched_;
  std::string ignored_;
  Paint paint_;
  Lead lead_;
  double t_ = 0.0;  // [s]
  std::uint64_t frames_ = 0;
};

}  // namespace palpate::robot
