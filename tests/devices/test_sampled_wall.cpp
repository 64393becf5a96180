// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "palpate/io/devices/device_body.hpp"

namespace palpate {
namespace test_sampled_wall {

SampledWall touch_wall(double damping) {
  return {.handle = {.mass = 0.06, .damping = 0.7, .stiffness = 0.0},
          .damping = damping,
          .period = 1e-3,
          .delay = 1e-3};
}

TEST(LinearStiffness, IsThatOfTheClosedFormWithoutADamper) {
  // What a spring's hold and delay take away is damping as long as the swing is slow.
  for (const double delay : {0.0, 0.25e-3, 1e-3, 1.75e-3, 4e-3}) {
    SampledWall wall = touch_wall(0.0);
    wall.delay = delay;
    EXPECT_NEAR(linear_stiffness(wall, 1e5), delayed_stiffness(wall),
                0.01 * delayed_stiffness(wall))
        << delay;
  }
  EXPECT_NEAR(delayed_stiffness(touch_wall(0.0)), 466.7, 0.1);
}

TEST(LinearStiffness, ADamperHelpsUntilItsOwnDelayUndoesIt) {
  EXPECT_NEAR(linear_stiffness(touch_wall(2.0), 1e5), 1536.0, 10.0);
  EXPECT_GT(linear_stiffness(touch_wall(15.0), 1e5), linear_stiffness(touch_wall(4.0), 1e5));
  EXPECT_GT(linear_stiffness(touch_wall(15.0), 1e5), 1.2 * linear_stiffness(touch_wall(30.0), 1e5));
  EXPECT_EQ(linear_stiffness(touch_wall(1000.0), 1e5), 0.0) << "the damper alone swings";
  EXPECT_EQ(linear_stiffness(touch_wall(2.0), 1000.0), 1000.0) << "no more than asked for";
}

}  // namespace test_sampled_wall
}  // namespace palpate
