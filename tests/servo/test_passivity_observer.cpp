// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <functional>
#include <limits>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/servo/passivity_observer.hpp"

#include "tests/servo/fake_device.hpp"
#include "tests/support/grids.hpp"

namespace palpate {
namespace test_passivity_observer {

constexpr double stiffness = 600.0;  // [N/m]
constexpr double period = 1e-3;      // [s]

// A hand on a spring that is told where both are. Heights [m] as functions of time.
struct Spring {
  PassivityObserver observer;
  double t = 0.0;

  const ServoEnergy& tick(double hand, double surface, double velocity, double dt = period) {
    t += dt;
    const Vec3 hip(0, 0, hand);
    return observer.run({.t = t,
                         .handle = hip,
                         .hip = hip,
                         .scale = 1.0,
                         .surface = velocity * Vec3::UnitZ(),
                         .jumped = false,
                         .sent = stiffness * std::max(surface - hand, 0.0) * Vec3::UnitZ()});
  }

  // Presses on a surface at rest to a depth and comes back at the same speed, then waits.
  void press(double depth, double speed, double dt = period) {
    const double step = speed * dt;
    const int n = static_cast<int>(std::lround(depth / step));
    for (int i = 0; i <= n; ++i) tick(-i * step, 0.0, 0.0, dt);
    for (int i = n - 1; i >= -1; --i) tick(-i * step, 0.0, 0.0, dt);
    for (int i = 0; i < 30; ++i) tick(step, 0.0, 0.0, dt);
  }
};

TEST(PassivityObserver, SeesWhatASpringThatIsHeldOverEachTickMakes) {
  // In: -K s^2 n (n-1)/2, out: K s^2 n (n+1)/2 with steps s = v T: K v T times the depth is made.
  for (const double dt : {period, 0.25 * period}) {
    Spring spring;
    spring.press(0.008, 0.1, dt);
    const ServoEnergy& energy = spring.observer.energy();
    const double expected = stiffness * 0.1 * dt * 0.008;
    EXPECT_NEAR(energy.relative.excess, expected, 1e-9);
    EXPECT_NEAR(energy.relative.made, expected, 1e-9);
    EXPECT_NEAR(energy.absolute.made, expected, 1e-9) << "the same on a surface at rest";
    EXPECT_EQ(energy.contacts, 1U);
    EXPECT_EQ(energy.relative.generating, expected > PortEnergy::least_made ? 1U : 0U);
  }
}

// Hazard: torque
TEST(PassivityObserver, AddsTheWorkOfATorque) {
  PassivityObserver observer;
  PassivityObserver::Input input{.t = 0.0,
                                 .handle = Vec3::Zero(),
                                 .hip = Vec3::Zero(),
                                 .scale = 2.0,
                                 .surface = Vec3::Zero(),
                                 .jumped = false,
                                 .sent = Vec3::Zero(),
                                 .torque = Vec3(0, 0.05, 0),
                                 .turned = Vec3(0, 0.01, 0.02)};
  for (int i = 0; i <= 10; ++i, input.t += period) observer.run(input);
  EXPECT_NEAR(observer.energy().absolute.excess, 0.05 * 0.1, 1e-12);
  EXPECT_NEAR(observer.energy().relative.excess, 0.05 * 0.1, 1e-12);
  EXPECT_EQ(observer.energy().contacts, 1U);
}

TEST(PassivityObserver, AddsUpContactsAndCountsThoseThatMakeMuch) {
  Spring spring;
  spring.press(0.008, 0.1);   // 0.48 mJ
  spring.press(0.002, 0.01);  // 0.012 mJ
  spring.press(0.004, 0.1);   // 0.24 mJ
  const ServoEnergy& energy = spring.observer.energy();
  EXPECT_EQ(energy.contacts, 3U);
  EXPECT_EQ(energy.relative.generating, 2U);
  EXPECT_NEAR(energy.relative.made, 0.732e-3, 1e-8);
  EXPECT_NEAR(energy.relative.most, 0.24e-3, 1e-8) << "of the last one";
  EXPECT_TRUE(energy.relative.generates());
}

TEST(PassivityObserver, TakesNoHonestLiftForEnergyMade) {
  // Pressed in and held while the surface rises by 50 mm with the hand.
  Spring spring;
  for (int i = 0; i <= 80; ++i) spring.tick(-1e-4 * i, 0.0, 0.0);
  constexpr double speed = 0.05;
  double height = 0.0;
  for (int i = 0; i < 1000; ++i) {
    height += speed * period;
    spring.tick(-0.008 + height, height, speed);
  }
  const ServoEnergy& energy = spring.observer.energy();
  EXPECT_NEAR(energy.absolute.excess, stiffness * (0.008 * 0.05 - 0.5 * 0.008 * 0.008), 1e-3);
  EXPECT_TRUE(energy.absolute.generates());
  EXPECT_EQ(energy.relative.made, 0.0);
  EXPECT_NEAR(energy.relative.excess, -0.5 * stiffness * 0.008 * 0.008, 3e-4);
}

TEST(PassivityObserver, SeesASurfaceThatAFrameMovesUnderAHand) {
  // Pressed 4 mm deep, corrected to 6 mm by a frame, let go: 1/2 K (6^2 - 4^2) is made.
  Spring spring;
  for (int i = 0; i <= 400; ++i) spring.tick(-1e-5 * i, 0.0, 0.0);
  for (int i = 0; i <= 610; ++i) spring.tick(-0.004 + 1e-5 * i, 0.002, 0.0);
  EXPECT_NEAR(spring.observer.energy().relative.most, 0.5 * stiffness * (36e-6 - 16e-6), 1e-4);
}

TEST(PassivityObserver, TakesADeviceThatDoesNotMoveForWhatItIs) {
  Spring spring;
  for (int i = 0; i < 1000; ++i) spring.tick(-0.004, 0.001 * (i % 2), 0.0);
  const ServoEnergy& energy = spring.observer.energy();
  EXPECT_EQ(energy.absolute.excess, 0.0);
  EXPECT_EQ(energy.relative.made, 0.0);
  EXPECT_EQ(energy.contacts, 1U);
}

TEST(PassivityObserver, UsesTheRealTimeAndLeavesOutWhatItCannotKnow) {
  const auto lift = [](double dt) {  // [J] relative, of a hand at rest over a surface that sinks
    Spring spring;
    spring.tick(-0.004, 0.0, 0.0);
    return spring.tick(-0.004, 0.0, -0.1, dt).relative.excess;
  };
  EXPECT_NEAR(lift(0.01), 2.4 * 0.001, 1e-12) << "nine ticks were dropped";
  EXPECT_EQ(lift(0.06), 0.0) << "nobody knows what the device did";
  EXPECT_EQ(lift(0.0), 0.0);
  EXPECT_EQ(lift(-5.0), 0.0) << "the clock was put back";
  EXPECT_EQ(lift(std::nan("")), 0.0);
}

TEST(PassivityObserver, ForgetsThePlaceAfterWhatIsNotANumberAndKeepsWhatWasCounted) {
  Spring spring;
  spring.press(0.008, 0.1);
  const double made = spring.observer.energy().relative.made;
  spring.tick(-0.004, 0.0, 0.0);
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e300}) {
    spring.tick(bad, 0.0, 0.0);
    spring.tick(-0.004, 0.0, bad);
    spring.tick(0.5, 0.0, 0.0);  // 0.5 m from where the force was
    spring.tick(-0.004, 0.0, 0.0);
  }
  EXPECT_EQ(spring.observer.energy().relative.made, made);
}

TEST(PassivityObserver, LeavesOutWhatThePlacementMovesAndScalesBackToTheHand) {
  const auto made = [](bool jumped, double scale, double hip) {
    PassivityObserver observer;
    PassivityObserver::Input input{.t = 0.0,
                                   .handle = Vec3::Zero(),
                                   .hip = Vec3::Zero(),
                                   .scale = scale,
                                   .surface = Vec3::Zero(),
                                   .jumped = false,
                                   .sent = Vec3(0, 0, 2.0)};
    observer.run(input);
    input.t = period;
    input.handle = Vec3(0, 0, 1e-4);
    input.hip = Vec3(0, 0, hip);
    input.jumped = jumped;
    return observer.run(input).relative.made;
  };
  EXPECT_NEAR(made(false, 5.0, 5e-4), 2e-4, 1e-15) << "5 m of the scene are 1 m of the hand";
  EXPECT_NEAR(made(true, 1.0, 1.0), 2e-4, 1e-15) << "the placement has changed";
}

// A method that pushes up with a spring from a height, whatever the camera sees.
class Floor final : public Method {
 public:
  void seat(const Vec3& /*proxy*/) noexcept override {}
  void observe(const Observation& /*seen*/) noexcept override {}
  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick;
    tick.t = t;
    tick.hip = hip;
    tick.proxy = Vec3(hip.x(), hip.y(), std::max(hip.z(), height));
    tick.normal = Vec3::UnitZ();
    tick.force = stiffness * (tick.proxy - hip);
    tick.surface_motion = motion;
    return tick;
  }
  void set_parameters(const Parameters& /*parameters*/) noexcept override {}

  double height = 0.0;
  Vec3 motion = Vec3::Zero();
};

TEST(PassivityObserver, SeesInACycleTheForceThatWasSentInTheDevicesOwnAxes) {
  const auto floor = std::make_shared<Floor>();
  test::FakeDevice device;
  ServoSettings settings;
  settings.safety.ramp_time = 0.01;
  // The device's x axis is the scene's z axis, and a metre of it 2 of the scene.
  settings.placement.workspace_scale = 2.0;
  settings.placement.world_from_device.linear() << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  Cycle cycle(floor, device, settings);
  auto reader = cycle.reader();
  ServoTick record{};
  const auto plane = std::make_shared<PointCloud>(test::flat_grid(), Vec3(0, 0, 1));
  double t = 0.0;
  Vec3 last = Vec3::Zero();
  Vec3 sent = Vec3::Zero();
  double by_hand = 0.0;
  const auto run = [&](double x) {
    const Vec3 now(x, 0, 0);
    by_hand += sent.dot(now - last);
    last = now;
    device.hand.position = now;
    t += period;
    if (static_cast<int>(std::lround(1e3 * t)) % 30 == 1) cycle.put_frame(plane, t, t);
    cycle.run({.t = t});
    ASSERT_TRUE(reader.try_pop(record));
    sent = device.force;
  };
  for (int i = 0; i < 100; ++i) run(0.001);
  for (int i = 0; i < 20; ++i) run(0.001 - 2e-4 * i);
  for (int i = 20; i > -30; --i) run(0.001 - 2e-4 * i);
  EXPECT_EQ(record.energy.contacts, 1U);
  EXPECT_GT(by_hand, PortEnergy::least_made);
  EXPECT_NEAR(record.energy.absolute.excess, by_hand, 1e-12);
  EXPECT_NEAR(record.energy.relative.excess, by_hand, 1e-12);
  EXPECT_EQ(record.energy.relative.generating, 1U);
}

}  // namespace test_passivity_observer
}  // namespace palpate
