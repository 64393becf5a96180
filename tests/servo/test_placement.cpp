// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>

#include "palpate/cloud/point_cloud.hpp"
#include "palpate/methods/methods.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/servo/placement_table.hpp"

#include "tests/servo/fake_device.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/grids.hpp"

namespace palpate {
namespace {

TEST(PlacementTable, GivesBackWhatWasSetAndLeavesTheRestAlone) {
  Placement placement;
  set_placement(placement, "roll", 0.3);
  set_placement(placement, "pitch", -0.4);
  set_placement(placement, "yaw", 1.2);
  set_placement(placement, "origin_y", -0.25);
  set_placement(placement, "scale", 3.0);
  validate(placement);
  const double expected[] = {3.0, 0.0, -0.25, 0.0, 0.3, -0.4, 1.2};
  std::size_t i = 0;
  for (const PlacementInfo& row : placement_table())
    EXPECT_NEAR(row.get(placement), expected[i++], 1e-12) << row.name;
  // R = R_z R_y R_x: the device's x axis turned by pitch, then by yaw.
  const Vec3 x = placement.world_from_device.linear() * Vec3::UnitX();
  EXPECT_LT((x - Vec3(std::cos(0.4) * std::cos(1.2), std::cos(0.4) * std::sin(1.2), std::sin(0.4)))
                .norm(),
            1e-12);
}

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

}  // namespace
}  // namespace palpate
