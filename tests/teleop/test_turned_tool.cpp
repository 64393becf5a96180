// SPDX-License-Identifier: Apache-2.0
// A robot's end whose tool has a shape and turns, before a noisy camera.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/net/teleop/approach_watch.hpp"
#include "palpate/net/teleop/robot.hpp"
#include "palpate/net/teleop/set_point.hpp"

namespace palpate {
namespace test_turned_tool {

constexpr double tick = 1e-3;                // [s]
constexpr double frame_interval = 1 / 30.0;  // [s]
constexpr const char* box = "box:40x20x5mm";
const Rotation upright = Rotation::Identity();

// A ball or a box at a robot that follows with a loop of 4 Hz; the plane z = 0 is seen from above.
class RobotsEnd {
 public:
  explicit RobotsEnd(const std::string& tool, bool turns = true, const Rotation& found = upright,
                     const Vec3& begin = above)
      : shape_(make_tool(box, {})),
        camera_(open_synthetic_camera(
            Uri("synthetic:plane?size=320x240&fov=40deg&distance=0.6m&sensor=d4xx&seed=7"))),
        // Nothing holds it up.
        robot_(begin,
               [](const Vec3&, double) {
                 return SimulatedTool::Surface{1.0, Vec3::UnitZ()};
               }),
        turns_(turns) {
    turn_.orientation = found;
    const auto led_with = tool == "ball" ? nullptr : make_tool(tool, {});
    LeadLimits limits{.turns = turns};
    SetPointOptions options{.turns = turns};
    options.lag = SimulatedTool::lag();
    if (led_with) options.tool_reach = led_with->reach();
    hand_ = std::make_unique<LedHand>(begin, limits, found);
    step_ = std::make_unique<RobotStep>(*hand_, options);
    ServoSettings settings;
    set_parameter(settings.parameters, "r_c", SimulatedTool::radius + options.margin);
    cycle_ = std::make_unique<Cycle>(
        make_method("sight", settings.parameters, standard_methods(), led_with), *hand_, settings);
    ticks_.emplace(cycle_->reader());
  }

  // Led for so long. @return [m] the lowest corner of the true box meanwhile
  double run(double seconds, const std::function<Lead(double t)>& lead) {
    double lowest = std::numeric_limits<double>::infinity();
    for (const double end = t_ + seconds; t_ < end; t_ += tick) {
      if (t_ >= static_cast<double>(frames_) * frame_interval - 1e-9) {
        const Frame frame = camera_->capture(t_, frames_++);
        cycle_->put_frame(frame.cloud, t_, t_);
        watch_.frame(frame.cloud, t_, robot_.place());
      }
      lead_ = lead(t_);
      hand_->lead(lead_, t_);
      hand_->tool_is_at(robot_.place(), turn_.orientation);
      cycle_->run({.t = t_});
      ServoTick seen;
      EXPECT_TRUE(ticks_->try_pop(seen));
      const Outlook look =
          outlook({&watch_, 1}, seen.place, robot_.place(), SimulatedTool::radius, t_);
      RobotState at{.t = t_,
                    .position = robot_.place(),
                    .orientation = turn_.orientation,
                    .velocity = robot_.velocity()};
      order_ = step_->next(seen, look, lead_.press, at, t_);
      EXPECT_TRUE(order_.position.allFinite() && is_rotation(order_.orientation));
      robot_.lead_to(order_.position, t_ + tick, tick);
      if (turns_) turn_.follow(order_.orientation, tick);
      lowest = std::min(lowest, this->lowest());
    }
    return lowest;
  }
  [[nodiscard]] double lowest() const {
    double least = std::numeric_limits<double>::infinity();
    for (const ToolShape::Point& point : shape_->points())
      least = std::min(least, (robot_.place() + turn_.orientation * point.at).z());
    return least;
  }
  [[nodiscard]] const Rotation& orientation() const { return turn_.orientation; }
  [[nodiscard]] const Vec3& place() const { return robot_.place(); }
  [[nodiscard]] const char* trouble() const { return step_->trouble(); }
  [[nodiscard]] bool is_led() const { return step_->is_led(); }
  void hold_turn() { turns_ = false; }

  static inline const Vec3 above{0.0, 0.0, 0.05};

 private:
  std::shared_ptr<const ToolShape> shape_;
  std::unique_ptr<SyntheticCamera> camera_;
  std::unique_ptr<LedHand> hand_;
  std::unique_ptr<RobotStep> step_;
  std::unique_ptr<Cycle> cycle_;
  std::optional<TickRing<ServoTick>::Reader> ticks_;
  ApproachWatch watch_;
  SimulatedTool robot_;
  SimulatedTurn turn_;
  bool turns_;
  Lead lead_;
  SetPoint::Order order_;
  std::uint64_t frames_ = 0;
  double t_ = 0.0;
};

double angle(const Rotation& a, const Rotation& b) { return rotation_vector(between(a, b)).norm(); }

const Rotation tilted = product(rotation_by({0.0, 0.5, 0.0}), rotation_by({0.3, 0.0, 0.0}));

// 10 mm into the plane, tilted; then flat; then over the plane, turning all the time.
double work(RobotsEnd& robot) {
  const Vec3 in(0.0, 0.0, -0.01);
  double lowest = robot.run(1.0, [&](double) {
    return Lead{RobotsEnd::above, Vec3::Zero(), tilted, true};
  });
  lowest = std::min(lowest, robot.run(2.0, [&](double) {
    return Lead{in, Vec3::Zero(), tilted, true};
  }));
  lowest = std::min(lowest, robot.run(3.0, [&](double) {
    return Lead{in, Vec3::Zero(), upright, true};
  }));
  return std::min(lowest, robot.run(8.0, [&](double t) {
    const Vec3 way(0.04 * std::sin(t), 0.03 * std::cos(1.3 * t), 0.01 * std::sin(2.0 * t));
    const Vec3 turn(0.6 * std::sin(1.7 * t), 0.6 * std::cos(1.1 * t), 0.5 * t);
    return Lead{way, Vec3::Zero(), rotation_by(turn), true};
  }));
}

// Hazard: robot-collides
TEST(TurnedTool, StaysInFrontOfANoisyPlaneWithAllOfItsShape) {
  RobotsEnd shaped(std::string(box) + "?margin=0.002m");
  EXPECT_GT(work(shaped), 2e-3) << "the margin";
  RobotsEnd ball("ball");
  EXPECT_LT(work(ball), -5e-3) << "the plane is not touched";
}

TEST(TurnedTool, IsTurnedAsTheOperatorsFromHowItWasFound) {
  const Rotation found = rotation_by({2.0, 0.0, 1.0});
  RobotsEnd robot(box, true, found);
  robot.run(2.0, [](double) { return Lead{RobotsEnd::above, Vec3::Zero(), upright, true}; });
  EXPECT_LT(angle(robot.orientation(), found), 1e-6);
  robot.run(3.0, [](double) { return Lead{RobotsEnd::above, Vec3::Zero(), tilted, true}; });
  EXPECT_LT(angle(robot.orientation(), product(tilted, found)), 1e-3);
  // As the hand moves no more, the tool rests how it is.
  robot.run(0.1, [](double) { return Lead{RobotsEnd::above, Vec3::Zero(), upright, true}; });
  robot.run(0.3, [](double) { return Lead{}; });
  const Rotation rests = robot.orientation();
  robot.run(1.0, [](double) { return Lead{}; });
  EXPECT_LT(angle(robot.orientation(), rests), 5e-3);
  EXPECT_GT(angle(rests, found), 0.05) << "it was there already";
}

// Hazard: robot-collides
TEST(TurnedTool, RestsWhereItsShapeCannotBeGuarded) {
  const auto down = [](double) { return Lead{Vec3(0.0, 0.0, 0.01), Vec3::Zero(), tilted, true}; };
  // An arm that was said to turn, and does not.
  RobotsEnd stiff(std::string(box) + "?margin=0.002m");
  stiff.hold_turn();
  bool was_said = false;
  EXPECT_GT(stiff.run(4.0,
                      [&](double t) {
                        was_said = was_said || std::string(stiff.trouble()).find("does not turn") !=
                                                   std::string::npos;
                        return down(t);
                      }),
            -1e-3);
  EXPECT_TRUE(was_said);
  // A shape at one that cannot: it may not rely on a proxy that turns where it is pressed.
  RobotsEnd fixed(std::string(box) + "?margin=0.002m", false, tilted);
  was_said = false;
  EXPECT_GT(fixed.run(5.0,
                      [&](double) {
                        was_said =
                            was_said || std::string(fixed.trouble()).find("robot that turns") !=
                                            std::string::npos;
                        return Lead{Vec3(0.0, 0.0, -0.01), Vec3::Zero(), upright, true};
                      }),
            -1e-3);
  EXPECT_TRUE(was_said);
  // One that begins in what is seen is not led.
  const Vec3 begin(0.0, 0.0, -0.006);
  RobotsEnd inside(box, true, tilted, begin);
  inside.run(1.0, [](double) {
    return Lead{Vec3(0.0, 0.0, -0.02), Vec3::Zero(), rotation_by({0.0, 0.0, 1.0}), true};
  });
  EXPECT_NE(std::string(inside.trouble()).find("move the arm"), std::string::npos);
  EXPECT_FALSE(inside.is_led());
  EXPECT_LT(angle(inside.orientation(), tilted), 1e-3);
  EXPECT_LT((inside.place() - begin).norm(), 1e-3) << inside.place().transpose();
}

}  // namespace test_turned_tool
}  // namespace palpate
