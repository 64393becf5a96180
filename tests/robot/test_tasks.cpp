// SPDX-License-Identifier: Apache-2.0
// What an operator does with the simulated arm over a link with delay: presses a box that moves and
// strokes along an edge. All of it stepped, the same every time.
#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "palpate/devices/scripted_device.hpp"
#include "palpate/methods/methods.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/teleop/approach_watch.hpp"
#include "palpate/teleop/lead.hpp"
#include "palpate/teleop/led_hand.hpp"
#include "palpate/teleop/link_limits.hpp"
#include "palpate/teleop/set_point.hpp"

#include "robot/simulated_cell.hpp"

namespace palpate::robot {
namespace {

constexpr double tick = 1e-3;            // [s]
constexpr double camera_latency = 0.03;  // [s]

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

class Task {
 public:
  // @param delay  [s] of the link, one way
  Task(const std::string& options, const HipPath& hand, double delay, SetPointOptions wanted = {})
      : cell_(Uri("mujoco:desk?size=320x240&quantisation=0.05mm" + options), Pace::stepped),
        camera_(cell_.camera()),
        hand_(hand, false),
        operator_(make_method("sight"), hand_, operator_settings(delay), 4),
        led_(cell_.simulation()->truth().tip),
        guard_(make_method("sight"), led_, guard_settings(wanted), 4),
        felt_(operator_.reader()),
        guarded_(guard_.reader()),
        set_point_(set_point(wanted)),
        leads_(delay),
        to_guard_(camera_latency),
        to_operator_(camera_latency + delay) {}

  Simulation& simulation() { return *cell_.simulation(); }

  void run(double seconds, const std::function<void(const ServoTick& felt)>& look = {}) {
    for (const double end = t_ + seconds; t_ < end; t_ += tick) {
      simulation().advance(t_);
      if (t_ + 1e-9 >= static_cast<double>(frames_) / 30.0) {
        const Frame frame = *camera_->next();
        ++frames_;
        to_guard_.send({frame.cloud, frame.stamp}, t_);
        to_operator_.send({frame.cloud, frame.stamp}, t_);
      }
      if (const auto seen = to_operator_.arrived(t_))
        operator_.put_frame(seen->cloud, seen->stamp, t_);
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
    led_.clearance(guarded.tick.state == ContactState::free_motion
                       ? watch_.clearance() - simulation().info().tool_radius
                       : 0.0);
    const SetPoint::Order order =
        set_point_.next(guarded, lead_.press, led_.is_led(), watch_.newest(), state.force);
    simulation().command(order.position, order.velocity);
  }

  SimulatedCell cell_;
  std::unique_ptr<Source> camera_;
  ScriptedDevice hand_;
  Cycle operator_;
  LedHand led_;
  Cycle guard_;
  TickRing<ServoTick>::Reader felt_, guarded_;
  ApproachWatch watch_;
  SetPoint set_point_;
  Delayed<Lead> leads_;
  Delayed<Seen> to_guard_, to_operator_;
  Lead lead_;
  double t_ = 0.0;  // [s]
  std::uint64_t frames_ = 0;
};

class Tasks : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Delays, Tasks, ::testing::Values(0.0, 0.25),
                         [](const auto& one) { return one.param > 0.0 ? "Far" : "Near"; });

TEST_P(Tasks, PressesABoxThatMoves) {
  // Against the side that the camera sees, and 40 mm on.
  const HipPath hand({{0.0, {0.10, 0.0, 0.05}},
                      {2.5, {0.10, 0.0, 0.05}},
                      {3.5, {0.10, 0.06, 0.05}},
                      {8.0, {0.10, 0.105, 0.05}}});
  Task task("", hand, GetParam(), {.press_share = 1.0});
  const double before = task.simulation().pose("box").translation().y();
  double hardest = 0.0;
  task.run(10.0, [&](const ServoTick&) {
    hardest = std::max(hardest, task.simulation().truth().tip_force.norm());
  });
  EXPECT_GT(task.simulation().pose("box").translation().y() - before, 0.02);
  EXPECT_LT(hardest, 8.0);
}

TEST_P(Tasks, StrokesAlongAnEdge) {
  // On the plate, 10 mm from its edge, pressed 5 mm in.
  const double top = 0.03;
  const HipPath hand({{0.0, {0.05, -0.08, 0.08}},
                      {2.5, {0.05, -0.08, 0.08}},
                      {3.5, {0.05, -0.08, top - 0.005}},
                      {4.5, {0.05, -0.08, top - 0.005}},
                      {8.0, {0.15, -0.08, top - 0.005}}});
  // The camera looks at the tool from the side: an arm hides what is under it.
  Task task("&tilt=55deg", hand, GetParam());
  const double height = top + task.simulation().info().tool_radius + SetPointOptions{}.margin;
  double farthest = 0.0;
  double deepest = 0.0;
  double softest = 100.0;
  double x = 0.0;
  double t = 0.0;
  task.run(9.0, [&](const ServoTick& felt) {
    const Truth truth = task.simulation().truth();
    deepest = std::max(deepest, truth.penetration);
    t += tick;
    if (t > 5.0 && t < 8.2) farthest = std::max(farthest, std::abs(truth.tip.z() - height));
    if (t > 5.0 && t < 8.2) softest = std::min(softest, felt.force.norm());
    x = truth.tip.x();
  });
  EXPECT_GT(softest, 0.3);
  EXPECT_GT(x, 0.14);
  EXPECT_LT(farthest, 2e-3);
  EXPECT_LT(deepest, 0.5e-3);
}

}  // namespace
}  // namespace palpate::robot
