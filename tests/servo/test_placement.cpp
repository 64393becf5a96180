// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/servo/placement.hpp"
#include "palpate/servo/stiffness.hpp"

#include "tests/servo/fake_device.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/grids.hpp"

namespace palpate {
namespace test_placement {

TEST(PlacementTable, GivesBackWhatWasSetAndLeavesTheRestAlone) {
  Placement placement;
  set_placement(placement, "roll", 0.3);
  set_placement(placement, "pitch", -0.4);
  set_placement(placement, "yaw", 1.2);
  set_placement(placement, "origin_y", -0.25);
  set_placement(placement, "scale", 3.0);
  validate(placement);
  set_placement(placement, "bubble_radius", 0.06);
  set_placement(placement, "bubble_speed", 0.3);
  set_placement(placement, "handle_weight", 0.045);
  const double expected[] = {3.0, 0.0, -0.25, 0.0, 0.3, -0.4, 1.2, 0.06, 0.3, 0.045};
  std::size_t i = 0;
  for (const PlacementInfo& row : placement_table())
    EXPECT_NEAR(row.get(placement), expected[i++], 1e-12) << row.name;
  // R = R_z R_y R_x: the device's x axis turned by pitch, then by yaw.
  const Vec3 x = placement.world_from_device.linear() * Vec3::UnitX();
  EXPECT_LT((x - Vec3(std::cos(0.4) * std::cos(1.2), std::cos(0.4) * std::sin(1.2), std::sin(0.4)))
                .norm(),
            1e-12);
}

// Hazard: bad-settings
TEST(PlacementTable, RefusesUnknownNamesAndValuesOutOfRange) {
  Placement placement;
  const auto set = [&](const char* name, double value) {
    return [&placement, name, value] {
      set_placement(placement, name, value);
      return 0;
    };
  };
  EXPECT_TRUE(test::fails_saying(set("scal", 1.0), "scal", "scale"));
  EXPECT_TRUE(test::fails_saying(set("scale", 0.0), "scale", "out of range"));
  EXPECT_TRUE(test::fails_saying(set("yaw", std::nan("")), "yaw", "out of range"));
  EXPECT_EQ(placement, Placement{});
}

// Hazard: scene-jumps
TEST(Placement, ThatChangesInContactTakesTheForceOffUntilTheHandEngagesAgain) {
  test::FakeDevice device;
  Cycle cycle(make_method(), device);
  auto reader = cycle.reader();
  const auto plane = std::make_shared<PointCloud>(test::flat_grid(), Vec3(0, 0, 1));
  ServoTick record{};
  const auto run = [&](int from, int ticks, double z) {
    for (int i = from; i < from + ticks; ++i) {
      const double t = 1e-3 * i;
      if (i % 33 == 0) cycle.put_frame(plane, t, t);
      device.hand.position = Vec3(0, 0, z);
      cycle.run({.t = t});
      static_cast<void>(reader.try_pop(record));
    }
    return device.force.norm();
  };
  run(0, 2000, 0.02);
  for (int i = 0; i < 200; ++i) run(2000 + i, 1, 0.02 - 1.15e-4 * i);
  ASSERT_GT(run(2200, 500, -0.003), 1.0) << "it presses";
  ServoSettings settings;
  settings.placement.world_from_device.translation().z() = -0.004;  // deeper into the plane
  cycle.set_settings(settings);
  const double before = device.force.norm();
  double largest = 0.0;
  for (int i = 0; i < 300; ++i) largest = std::max(largest, run(2700 + i, 1, -0.003));
  EXPECT_LE(largest, before) << "a jump of the placement must not push harder";
  EXPECT_EQ(run(3000, 500, -0.003), 0.0) << "disengaged while the hand presses";
  run(3500, 500, 0.03);
  EXPECT_NE(record.safety & ramping, 0U) << "free again, it engages";
}

// 0.15 m of device: a hand that never goes farther than 0.075 m from its middle.
TEST(Bubble, ReachesAMetreOfSceneFromADevicesFifteenCentimetres) {
  constexpr double dt = 1e-3;
  constexpr double reach = 0.075;
  const Placement placement{.bubble_radius = 0.05, .bubble_speed = 0.1};
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      Workspace workspace(placement);
      HandState hand;
      double t = 0.0;
      double x = 0.0;
      double hip = 0.0;
      // Out within a second, there until half a metre is reached, and back to the middle.
      for (int tick = 0; tick < 10'000 && x >= 0.0; ++tick) {
        x += std::abs(hip) < 0.5 && tick < 8000 ? std::min(7.5e-5, reach - x) : -7.5e-5;
        hand.position = side * x * Vec3::Unit(axis);
        const double next = workspace.hip_in_world(hand, t += dt)[axis];
        // The hand's own 0.075 m/s and the bubble's, and never more.
        EXPECT_LE(std::abs(next - hip), (0.075 + placement.bubble_speed) * dt + 1e-12);
        hip = next;
      }
      EXPECT_GE(side * hip, 0.4) << "axis " << axis << ": it stays where it was led";
    }
  }
}

// A hand goes out along x through the rim and rests there, a quarter of the way into it.
TEST(Bubble, SendsTheHipOnWithoutAStepInPlaceOrSpeed) {
  constexpr double dt = 1e-3;
  const Placement placement{.workspace_scale = 2.0, .bubble_radius = 0.05, .bubble_speed = 0.2};
  validate(placement);
  Workspace workspace(placement);
  HandState hand;
  double t = 7.0;
  const auto hip_at = [&](double x) {
    hand.position = Vec3(x, 0.0, 0.0);
    return workspace.hip_in_world(hand, t += dt).x();
  };
  EXPECT_EQ(hip_at(0.0), 0.0);
  double last = 0.0;
  double last_speed = 0.0;
  for (double x = 0.0; x < 0.06; x += 1e-5) {
    const double hip = hip_at(x);
    const double speed = (hip - last) / dt;
    if (x < 0.05) {
      EXPECT_NEAR(hip, 2.0 * x, 1e-12) << "the hand leads within the bubble";
    }
    if (x > 1e-4) {
      EXPECT_LT(std::abs(speed - last_speed), 2e-4) << "[m/s] at " << x;
    }
    last_speed = speed;
    last = hip;
  }
  // Half the rim: a quarter of the speed.
  const double before = hip_at(0.06);
  for (int i = 0; i < 999; ++i) hip_at(0.06);
  EXPECT_NEAR(hip_at(0.06) - before, 0.05, 1e-9);
  // Back within the bubble the hand leads again, from where the HIP has come to.
  const double from = hip_at(0.04);
  EXPECT_NEAR(hip_at(-0.02) - from, 2.0 * -0.06, 1e-12);
  // Nobody, a fault and the clutch move nothing; a stall counts as 5 ms at most.
  hip_at(0.08);
  hand.present = false;
  const double left = hip_at(0.08);
  EXPECT_EQ(hip_at(0.08), left);
  hand.present = true;
  t += 10.0;
  EXPECT_NEAR(hip_at(0.08) - left, 5e-3 * 0.2, 1e-12);
  // Nor does a time that is no number, and nothing of it is left.
  const double sound = hip_at(0.08);
  EXPECT_EQ(workspace.hip_in_world(hand, std::nan("")).x(), sound);
  EXPECT_EQ(hip_at(0.08), sound);
  EXPECT_GT(hip_at(0.08), sound);
}

// Sliding over a plane, 3 mm deep by the hand, beyond the rim and back.
TEST(Bubble, GoesAlongASurfaceWithTheForceThatTheHandGives) {
  test::FakeDevice device;
  ServoSettings settings;
  settings.placement.bubble_radius = 0.02;
  Cycle cycle(make_method(), device, settings);
  auto reader = cycle.reader();
  const auto plane = std::make_shared<PointCloud>(test::flat_grid(), Vec3(0, 0, 1));
  ServoTick record{};
  int tick = 0;
  const auto run = [&](const Vec3& hand) {
    const double t = 1e-3 * tick;
    if (tick++ % 33 == 0) cycle.put_frame(plane, t, t);
    device.hand.position = hand;
    cycle.run({.t = t});
    static_cast<void>(reader.try_pop(record));
    return record.tick.force;
  };
  for (int i = 0; i < 2000; ++i) run(Vec3(0, 0, 0.01));
  for (int i = 0; i < 500; ++i) run(Vec3(0, 0, 0.01 - 2.6e-5 * i));
  Vec3 last = run(Vec3(0, 0, -0.003));
  ASSERT_GT(last.z(), 1.0);
  double largest_step = 0.0;
  const auto slide = [&](double x) {
    const Vec3 force = run(Vec3(x, 0, -0.003));
    largest_step = std::max(largest_step, (force - last).norm());
    EXPECT_NEAR(force.z(), settings.parameters.coupling.stiffness * 0.003, 0.02)
        << "the depth is the hand's alone, at " << x;
    last = force;
  };
  for (int i = 0; i <= 400; ++i) slide(1e-4 * i);
  for (int i = 0; i < 200; ++i) slide(0.04);
  EXPECT_NEAR(record.tick.proxy.x(), 0.04 + 0.1 * (0.2 + 0.2 / 3.0), 5e-3)
      << "the HIP went on by itself: 0.2 s at full speed, and a third of that on the way there";
  for (int i = 400; i >= 0; --i) slide(1e-4 * i);
  EXPECT_LT(largest_step, 0.1) << "[N] from tick to tick";
}

TEST(StiffnessWarnings, NameTheDevicesOwnBoundAndThatOfASampledWall) {
  DeviceInfo device{.uri = "touch:", .kind = "Touch", .limits = {.max_stiffness = 400.0}};
  EXPECT_TRUE(stiffness_warnings(device, 400.0, 1.0, 1000.0).empty());
  ASSERT_EQ(stiffness_warnings(device, 401.0, 1.0, 1000.0).size(), 1U);
  EXPECT_NE(stiffness_warnings(device, 600.0, 1.0, 1000.0)[0].find("set stiffness to 400 N/m"),
            std::string::npos);
  device.damping = 0.7;  // [N s/m]
  device.delay = 1e-3;   // [s]: 2 * 0.7 / (1 ms + 2 * 1 ms) = 466.7 N/m
  EXPECT_EQ(stiffness_warnings(device, 466.0, 1.0, 1000.0).size(), 1U);
  ASSERT_EQ(stiffness_warnings(device, 467.0, 1.0, 1000.0).size(), 2U);
  EXPECT_NE(stiffness_warnings(device, 467.0, 1.0, 1000.0)[1].find("466 N/m"), std::string::npos);
  EXPECT_EQ(stiffness_warnings(device, 467.0, 1.0, 2000.0).size(), 1U) << "560 N/m at 2 kHz";
  // A scene twice as large as the workspace feels twice as stiff.
  EXPECT_TRUE(stiffness_warnings(device, 200.0, 2.0, 1000.0).empty());
  ASSERT_EQ(stiffness_warnings(device, 230.0, 2.0, 1000.0).size(), 1U);
  EXPECT_NE(stiffness_warnings(device, 230.0, 2.0, 1000.0)[0].find("walls of 460 N/m"),
            std::string::npos);
  EXPECT_NE(stiffness_warnings(device, 230.0, 2.0, 1000.0)[0].find("stiffness to 200 N/m"),
            std::string::npos);
  device.limits.motors = false;
  EXPECT_TRUE(stiffness_warnings(device, 5000.0, 1.0, 1000.0).empty());
}

}  // namespace test_placement
}  // namespace palpate
