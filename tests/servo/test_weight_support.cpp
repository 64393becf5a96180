// SPDX-License-Identifier: Apache-2.0
// The weight of a handle that the motors hold up, beside the force of a surface.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/servo/weight_support.hpp"

#include "tests/servo/fake_device.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/grids.hpp"

namespace palpate {
namespace test_weight_support {

constexpr double weight = 0.05;               // [kg]
constexpr double newtons = weight * 9.80665;  // [N]

// A cycle above a plane z = 0, with a device that tilts its axes.
class Held {
 public:
  explicit Held(double max_force = 3.3) {
    settings.placement.handle_weight = weight;
    settings.placement.down = Vec3(0.6, 0.0, -0.8);
    settings.safety.max_force = max_force;
    settings.safety.initial_heat = 0.0;
    cycle = std::make_unique<Cycle>(make_method(), device, settings);
    reader.emplace(cycle->reader());
  }

  // [N] device, that the motors give after so many ticks with the hand at a height [m].
  Vec3 run(int ticks, double z) {
    for (int i = 0; i < ticks; ++i, ++tick) {
      const double t = 1e-3 * tick;
      if (tick % 33 == 0) cycle->put_frame(plane_, t, t);
      device.hand.position.z() = z;
      cycle->run({.t = t});
      static_cast<void>(reader->try_pop(record));
      largest_step = std::max(largest_step, (device.force - last).norm());
      last = device.force;
      largest = std::max(largest, device.force.norm());
    }
    return device.force;
  }
  void press() {
    for (int i = 0; i < 400; ++i) run(1, 0.02 - 7.5e-5 * i);
  }

  ServoSettings settings;
  test::FakeDevice device;
  std::unique_ptr<Cycle> cycle;
  std::optional<TickRing<ServoTick>::Reader> reader;
  ServoTick record{};
  int tick = 1000;
  Vec3 last = Vec3::Zero();
  double largest_step = 0.0, largest = 0.0;

 private:
  std::shared_ptr<PointCloud> plane_ =
      std::make_shared<PointCloud>(test::flat_grid(), Vec3(0, 0, 1));
};

// Hazard: handle-weight
TEST(WeightSupport, RisesSlowlyAgainstTheWeight) {
  Held held;
  EXPECT_EQ(held.run(1, 0.02).norm(), 0.0);
  EXPECT_NEAR(held.run(750, 0.02).norm(), 0.5 * newtons, 0.01 * newtons);
  const Vec3 all = held.run(1000, 0.02);
  EXPECT_LT((all - newtons * Vec3(-0.6, 0.0, 0.8)).norm(), 1e-12);
  EXPECT_LT(held.largest_step, 1e-3) << "[N] nobody feels a step";
  EXPECT_TRUE(held.record.force.isZero()) << "it is no force of a surface";
  EXPECT_EQ(held.record.energy.absolute.made, 0.0);
  EXPECT_TRUE(held.cycle->statistics().force_out) << "the watchdog has to know";
}

// Hazard: handle-weight
TEST(WeightSupport, IsGoneAtOnceWithoutAHandAndComesBackSlowly) {
  for (int why = 0; why < 4; ++why) {
    Held held;
    held.run(2000, 0.02);
    ASSERT_NEAR(held.device.force.norm(), newtons, 1e-12);
    if (why == 0) held.device.hand.present = false;
    if (why == 1) held.device.hand.fault = DeviceFault::overheated;
    if (why == 2) held.device.hand.position.x() = std::numeric_limits<double>::quiet_NaN();
    if (why == 3) held.tick += 30;  // the loop stalled
    EXPECT_EQ(held.run(1, 0.02).norm(), 0.0) << why;
    held.device.hand = {};
    EXPECT_LT(held.run(100, 0.02).norm(), 0.1 * newtons) << why;
    EXPECT_NEAR(held.run(2000, 0.02).norm(), newtons, 1e-12) << why;
  }
}

// Hazard: handle-weight
TEST(WeightSupport, IsGoneWhileAnotherPlacementBegins) {
  Held held;
  held.run(2000, 0.02);
  held.settings.placement.handle_weight = 1.5 * weight;
  held.cycle->set_settings(held.settings);
  EXPECT_EQ(held.run(1, 0.02).norm(), 0.0);
  EXPECT_NEAR(held.run(2000, 0.02).norm(), 1.5 * newtons, 1e-12);
}

// Hazard: handle-weight
TEST(WeightSupport, SharesTheLimitOfTheForceWithTheSurface) {
  Held held(1.0);
  held.run(3000, 0.02);
  held.press();
  const Vec3 both = held.run(3000, -0.01);
  EXPECT_NEAR(held.record.force.norm(), 1.0 - newtons, 1e-9) << "the surface gets the rest";
  EXPECT_NE(held.record.safety & force_cut, 0U);
  EXPECT_LE(held.largest, 1.0 + 1e-12);
  EXPECT_LT((both - held.record.force - newtons * Vec3(-0.6, 0.0, 0.8)).norm(), 1e-9);
  // Less is allowed now, in mid-contact.
  held.settings.safety.max_force = 0.3;
  held.settings.safety.fall_rate = 10.0;
  held.cycle->set_settings(held.settings);
  held.run(300, -0.01);
  EXPECT_LE(held.device.force.norm(), 0.3 + 1e-12);
}

// Hazard: handle-weight
TEST(WeightSupport, WarmsTheMotors) {
  const auto heat_after = [](double mass) {
    Held held;
    held.settings.placement.handle_weight = mass;
    held.cycle->set_settings(held.settings);
    held.run(20'000, 0.02);
    return held.cycle->statistics().heat.load();
  };
  EXPECT_EQ(heat_after(0.0), 0.0);
  // 20 s are one time constant of 20 s; 0.49 N of 0.88 N.
  const double share = newtons / 0.88;
  EXPECT_NEAR(heat_after(weight), share * share * (1.0 - std::exp(-1.0)), 0.04 * share * share);
}

// Hazard: handle-weight
TEST(WeightSupport, NeverGivesMoreThanANewtonOrTheLimit) {
  WeightSupport support;
  double t = 0.0;
  const auto after = [&](double wanted, double limit) {
    double force = 0.0;
    for (int i = 0; i < 2000; ++i) force = support.run(t += 1e-3, wanted, limit, true);
    return force;
  };
  EXPECT_EQ(after(5.0, 3.3), 1.0);
  EXPECT_EQ(after(0.5, 0.2), 0.2);
  EXPECT_EQ(after(0.5, -1.0), 0.0);
  EXPECT_EQ(support.run(t - 1.0, 0.5, 3.3, true), 0.0) << "a clock that runs back";
  EXPECT_EQ(support.run(std::nan(""), 0.5, 3.3, true), 0.0);
  Placement placement;
  placement.handle_weight = 0.11;
  const auto check = [&placement] {
    validate(placement);
    return 0;
  };
  EXPECT_TRUE(test::fails_saying(check, "handle_weight", "from 0 to 0.1 kg"));
  placement = {};
  placement.down = Vec3(0.0, 0.5, 0.0);
  EXPECT_TRUE(test::fails_saying(check, "down", "length 1"));
}

}  // namespace test_weight_support
}  // namespace palpate
