// SPDX-License-Identifier: Apache-2.0
// What the simulated arm finds out by touching, and how it feels at the operator's end.
#include <algorithm>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/devices/hip_path.hpp"

#include "tests/robot/task.hpp"

namespace palpate::robot {
namespace test_touched {

constexpr double top = 0.03;  // [m] of the plate

// Presses twice, 5 mm in, for a second.
HipPath two_presses() {
  const Vec3 above(0.10, -0.14, top + 0.03);
  const Vec3 in(0.10, -0.14, top - 0.005);
  return HipPath({{0.0, above},
                  {2.0, above},
                  {3.0, in},
                  {4.0, in},
                  {4.5, above},
                  {5.5, above},
                  {6.5, in},
                  {7.5, in}});
}

struct Felt {
  double first = 0.0, second = 0.0;  // [N] at the end of each press
  double truth = 0.0;                // [N/m] of the plate, by MuJoCo, at the end of the first
};

Felt press(Task& task) {
  Felt felt;
  double t = 0.0;
  task.run(7.4, [&](const ServoTick& tick_felt) {
    t += tick;
    if (t > 3.95 && t < 4.0) {
      const Truth truth = task.simulation().truth();
      felt.first = tick_felt.force.z();
      felt.truth = truth.tip_force.z() / truth.penetration;
    }
    felt.second = tick_felt.force.z();
  });
  return felt;
}

class Touching : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Delays, Touching, ::testing::Values(0.0, 0.25),
                         [](const auto& one) { return one.param > 0.0 ? "Far" : "Near"; });

TEST_P(Touching, MakesASoftThingSoftForTheHand) {
  ScriptedDevice hand(two_presses(), false);
  Task task(exact + "&tilt=20deg&arm=remembered&plate_stiffness=400", hand, GetParam(),
            {.press_share = 1.0});
  const Felt felt = press(task);
  ASSERT_TRUE(task.touched() && task.touched()->stiffness);
  EXPECT_NEAR(felt.truth, 400.0, 20.0);
  EXPECT_NEAR(*task.touched()->stiffness, felt.truth, 0.3 * felt.truth);
  EXPECT_EQ(task.ignored(), "");
  // 600 N/m, and then as soft as the plate.
  EXPECT_NEAR(felt.second / felt.first, felt.truth / 600.0, 0.15);
}

TEST(TouchingHard, ChangesNothingWhereAThingIsHard) {
  ScriptedDevice hand(two_presses(), false);
  Task task(exact + "&tilt=20deg&arm=remembered", hand, 0.0, {.press_share = 1.0});
  const Felt felt = press(task);
  ASSERT_TRUE(task.touched());
  EXPECT_EQ(task.ignored(), "ignored: it is not softer than the rendered stiffness");
  EXPECT_NEAR(felt.second, felt.first, 0.02 * felt.first);
}

}  // namespace test_touched
}  // namespace palpate::robot
