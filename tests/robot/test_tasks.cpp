// SPDX-License-Identifier: Apache-2.0
// What an operator does with the simulated arm over a link with delay: presses a box that moves,
// strokes along an edge, rests in the arm's shadow. All of it stepped, the same every time.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <gtest/gtest.h>

#include "palpate/io/devices/hip_path.hpp"

#include "tests/robot/task.hpp"

namespace palpate::robot {
namespace test_tasks {

class Tasks : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Delays, Tasks, ::testing::Values(0.0, 0.25),
                         [](const auto& one) { return one.param > 0.0 ? "Far" : "Near"; });

TEST_P(Tasks, PressesABoxThatMoves) {
  // Against the side that the camera sees, and 40 mm on. The tool hides most of that side: how far
  // the box gets changes with tenths of a millimetre of the hand, so that one hand says little.
  std::array<double, 3> moved{};
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const double x = 0.10 + 0.5e-3 * static_cast<double>(i);
    const HipPath path({{0.0, {x, 0.0, 0.05}},
                        {2.5, {x, 0.0, 0.05}},
                        {3.5, {x, 0.06, 0.05}},
                        {8.0, {x, 0.105, 0.05}}});
    ScriptedDevice hand(path, false);
    Task task(exact, hand, GetParam(), {.press_share = 1.0});
    const double before = task.simulation().pose("box").translation().y();
    double hardest = 0.0;
    task.run(10.0, [&](const ServoTick&) {
      hardest = std::max(hardest, task.simulation().truth().tip_force.norm());
    });
    moved[i] = task.simulation().pose("box").translation().y() - before;
    EXPECT_LT(hardest, 8.0) << x;
  }
  std::sort(moved.begin(), moved.end());
  EXPECT_GT(moved[1], 0.015);
}

TEST_P(Tasks, StrokesAlongAnEdge) {
  // On the plate, 10 mm from its edge, pressed 5 mm in.
  const double top = 0.03;
  const HipPath path({{0.0, {0.05, -0.08, 0.08}},
                      {2.5, {0.05, -0.08, 0.08}},
                      {3.5, {0.05, -0.08, top - 0.005}},
                      {4.5, {0.05, -0.08, top - 0.005}},
                      {8.0, {0.15, -0.08, top - 0.005}}});
  ScriptedDevice hand(path, false);
  // The camera looks at the tool from the side: an arm hides what is under it.
  Task task(exact + "&tilt=55deg", hand, GetParam());
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

TEST(ArmsShadow, FeelsWhatTheArmHides) {
  // On the plate, pressed 5 mm in, for 3 s, under the arm. With arm=hidden the force is 0 N from
  // the beginning and the tool gets 0.5 mm into the plate.
  const double top = 0.03;
  const HipPath path(
      {{0.0, {0.10, -0.14, 0.08}}, {2.5, {0.10, -0.14, 0.08}}, {3.5, {0.10, -0.14, top - 0.005}}});
  ScriptedDevice hand(path, false);
  Task task(exact + "&tilt=20deg&arm=remembered", hand, 0.0);
  double t = 0.0;
  double softest = 100.0;
  double deepest = 0.0;
  task.run(6.8, [&](const ServoTick& felt) {
    t += tick;
    if (t > 3.8) softest = std::min(softest, felt.force.z());
    deepest = std::max(deepest, task.simulation().truth().penetration);
  });
  EXPECT_GT(softest, 2.5);
  EXPECT_EQ(deepest, 0.0);
}

}  // namespace test_tasks
}  // namespace palpate::robot
