// SPDX-License-Identifier: Apache-2.0
// The simulated hand on a device with mass, damping, friction, resolution and delay, against closed
// forms.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/devices/devices.hpp"
#include "palpate/io/devices/simulated_hand.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/servo/stiffness.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/grids.hpp"

namespace palpate {
namespace test_device_body {

using test::fails_saying;

constexpr double ms = 1e-3;

HipPath resting_at(const Vec3& place) { return HipPath({{0.0, place}}); }

// A device that nobody holds.
HandModel alone(const DeviceBody& body) {
  return {.mass = 0.0, .stiffness = 0.0, .damping = 0.0, .tremor = 0.0, .body = body};
}

// Frictionless and exact, to be changed by each test.
constexpr DeviceBody plain{
    .mass = 0.06, .damping = 0.7, .friction = 0.0, .resolution = 0.0, .delay = 0.0};

TEST(ExactStep, IsTheLimitOfManySmallSteps) {
  struct Case {
    double damping, stiffness;
  };
  // Free, damped, under-, over- and critically damped, and nearly critical.
  for (const Case c :
       {Case{0, 0}, Case{2, 0}, Case{1e-3, 0}, Case{0, 300}, Case{2, 300}, Case{30, 300},
        Case{2 * std::sqrt(0.15 * 300), 300}, Case{2 * std::sqrt(0.15 * 300) * (1 + 1e-12), 300}}) {
    const MassSpringDamper system{0.15, c.damping, c.stiffness};
    const double dt = 0.05;
    Vec3 y(0.01, -0.02, 0.0);
    Vec3 v(0.3, 0.0, -1.0);
    const Vec3 g(0.5, -1.0, 2.0);
    Vec3 y_rk = y;
    Vec3 v_rk = v;
    const auto acceleration = [&](const Vec3& at, const Vec3& speed) {
      return Vec3((g - c.stiffness * at - c.damping * speed) / 0.15);
    };
    constexpr int steps = 2000;
    const double h = dt / steps;
    for (int i = 0; i < steps; ++i) {  // Runge-Kutta of fourth order
      const Vec3 a1 = acceleration(y_rk, v_rk);
      const Vec3 v2 = v_rk + 0.5 * h * a1;
      const Vec3 a2 = acceleration(y_rk + 0.5 * h * v_rk, v2);
      const Vec3 v3 = v_rk + 0.5 * h * a2;
      const Vec3 a3 = acceleration(y_rk + 0.5 * h * v2, v3);
      const Vec3 v4 = v_rk + h * a3;
      const Vec3 a4 = acceleration(y_rk + h * v3, v4);
      y_rk += h / 6.0 * (v_rk + 2.0 * v2 + 2.0 * v3 + v4);
      v_rk += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    }
    ExactStep(system, dt).advance(y, v, g);
    EXPECT_LT((y - y_rk).norm(), 1e-10) << c.damping << ' ' << c.stiffness;
    EXPECT_LT((v - v_rk).norm(), 1e-9) << c.damping << ' ' << c.stiffness;
  }
}

TEST(DeviceBody, CoastsToRestAsViscousDampingTells) {
  SimulatedHand hand(resting_at(Vec3::Zero()), alone(plain));
  hand.launch(Vec3::Zero(), {0.1, 0.0, -0.2});
  hand.read(5.0);
  const double tau = 0.06 / 0.7;
  for (int i = 1; i <= 1000; ++i) {
    const double t = i * ms;
    const double way = tau * -std::expm1(-t / tau);
    ASSERT_LT((hand.read(5.0 + t).position - way * Vec3(0.1, 0.0, -0.2)).norm(), 1e-9) << t;
  }
}

TEST(DeviceBody, IsStoppedByFrictionWhereItsEnergyIsUsedUp) {
  DeviceBody body = plain;
  body.damping = 0.0;
  body.friction = 0.26;
  SimulatedHand hand(resting_at(Vec3::Zero()), alone(body));
  hand.launch(Vec3::Zero(), {0.0, 0.1, 0.0});
  Vec3 position = Vec3::Zero();
  for (int i = 0; i <= 100; ++i) position = hand.read(i * ms).position;
  const double way = 0.06 * 0.1 * 0.1 / (2.0 * 0.26);  // m v^2 / 2 f
  EXPECT_NEAR(position.y(), way, 1e-9);
  EXPECT_EQ(hand.statistics().kinetic, 0.0) << "it stands";
  EXPECT_NEAR(hand.statistics().friction_loss, 0.5 * 0.06 * 0.01, 1e-9);
}

TEST(DeviceBody, IsStoppedByFrictionAndDampingTogether) {
  DeviceBody body = plain;
  body.friction = 0.26;
  SimulatedHand hand(resting_at(Vec3::Zero()), alone(body));
  const double v = 0.3;
  hand.launch(Vec3::Zero(), v * Vec3(1, 2, 2).normalized());
  Vec3 position = Vec3::Zero();
  for (int i = 0; i <= 200; ++i) position = hand.read(i * ms).position;
  // m v' = -b v - f: the way to v = 0.
  const double m = 0.06;
  const double b = 0.7;
  const double f = 0.26;
  const double way = m / b * (v - f / b * std::log1p(b * v / f));
  EXPECT_LT((position - way * Vec3(1, 2, 2).normalized()).norm(), 1e-7);
}

TEST(DeviceBody, SticksUntilAForceExceedsItsFriction) {
  DeviceBody body = plain;
  body.damping = 0.0;
  body.friction = 0.26;
  SimulatedHand hand(resting_at({0.01, 0, 0}), alone(body));
  hand.read(0.0);
  hand.write({0.18, -0.18, 0.0}, 0.0);  // 0.255 N
  EXPECT_EQ(hand.read(0.1).position, Vec3(0.01, 0, 0)) << "not even a little";
  hand.write({0.0, 0.0, 0.36}, 0.1);
  hand.read(0.1 + 50 * ms);
  EXPECT_NEAR(hand.read(0.2).position.z(), 0.5 * (0.36 - 0.26) / 0.06 * 0.01, 1e-9);
}

TEST(DeviceBody, GivesAForceOneTickAfterItWasWritten) {
  DeviceBody body = plain;
  body.delay = 1e-3;
  SimulatedHand hand(resting_at(Vec3::Zero()), alone(body));
  hand.read(7.0);
  hand.write(Vec3::UnitX(), 7.0);
  EXPECT_EQ(hand.read(7.001).position.x(), 0.0);
  hand.write(Vec3::Zero(), 7.001);
  EXPECT_GT(hand.read(7.002).position.x(), 5e-6);
  // One tick of force, no more: the momentum is F t, less what damping took.
  hand.read(7.003);
  const double p = std::sqrt(2.0 * 0.06 * hand.statistics().kinetic);
  EXPECT_NEAR(p, 1.0 * 1e-3, 0.03e-3);
}

TEST(DeviceBody, IsReadInStepsOfItsResolution) {
  DeviceBody body = plain;
  body.resolution = 0.055e-3;
  SimulatedHand hand(resting_at(Vec3::Zero()), alone(body));
  hand.launch(Vec3::Zero(), {0.1, -0.05, 0.0});
  for (int i = 0; i < 100; ++i) {
    const Vec3 steps = hand.read(i * ms).position / body.resolution;
    EXPECT_LT((steps - Vec3(steps.array().round())).norm(), 1e-9);
  }
}

TEST(DeviceBody, BooksItsEnergy) {
  DeviceBody body = plain;
  body.friction = 0.26;
  SimulatedHand hand(resting_at(Vec3::Zero()), alone(body));
  hand.launch(Vec3::Zero(), {0.5, 0.0, 0.0});
  const double kinetic = 0.5 * 0.06 * 0.25;
  std::mt19937 random(4);
  std::uniform_real_distribution<double> force(-2.0, 2.0);
  for (int i = 0; i < 3000; ++i) {
    hand.read(i * ms);
    if (i % 10 == 0) hand.write({force(random), force(random), force(random)}, i * ms);
  }
  const HandStatistics& s = hand.statistics();
  EXPECT_GT(s.friction_loss, 0.01);
  EXPECT_GT(s.damping_loss, 0.01);
  EXPECT_NEAR(kinetic + s.work, s.kinetic + s.friction_loss + s.damping_loss, 2e-4 * s.damping_loss)
      << "work in, losses and motion out";
}

// The largest excursion in the last of `seconds` at a sampled spring about 0, from 1 mm.
double excursion_at_a_wall(const DeviceBody& body, double stiffness, double seconds) {
  SimulatedHand hand(resting_at(Vec3::Zero()), alone(body));
  hand.launch({1e-3, 0, 0}, Vec3::Zero());
  double largest = 0.0;
  const int ticks = static_cast<int>(std::lround(seconds / ms));
  for (int i = 0; i < ticks; ++i) {
    const Vec3 position = hand.read(i * ms).position;
    hand.write(-stiffness * position, i * ms);
    if (i > ticks - 1000) largest = std::max(largest, std::abs(position.x()));
  }
  return largest;
}

TEST(DeviceBody, SwingsAtAWallStifferThanTheSampledBoundAndNotBelowIt) {
  // K < 2 b / (T + 2 t_d) = 467 N/m for a Touch without Coulomb friction and one tick of delay.
  DeviceBody touch = device_preset("touch").body;
  touch.friction = 0.0;
  touch.resolution = 0.0;
  EXPECT_LT(excursion_at_a_wall(touch, 460.0, 10.0), 0.7e-3) << "decays";
  EXPECT_GT(excursion_at_a_wall(touch, 480.0, 10.0), 1.5e-3) << "grows";
  // Without delay the bound is 2 b / T = 1400 N/m.
  touch.delay = 0.0;
  EXPECT_LT(excursion_at_a_wall(touch, 1300.0, 5.0), 0.7e-3);
  EXPECT_GT(excursion_at_a_wall(touch, 1500.0, 5.0), 1.5e-3);
}

TEST(DeviceBody, IsHeldByFrictionAtAWallThatIsTooStiffForItsDampingAlone) {
  const DeviceBody touch = device_preset("touch").body;
  EXPECT_LT(excursion_at_a_wall(touch, 600.0, 3.0), 0.5e-3) << "0.26 N: it sticks";
  DeviceBody worn = touch;
  worn.friction = 0.05;
  worn.resolution = 0.0;
  EXPECT_GT(excursion_at_a_wall(worn, 2000.0, 3.0), 1e-2) << "but not everywhere";
}

TEST(SimulatedHand, GetsNoForceWhileItsDeviceIsDisabled) {
  for (const bool with_body : {false, true}) {
    HandModel model{.tremor = 0.0};
    if (with_body) model.body = plain;
    SimulatedHand hand(resting_at(Vec3::Zero()), model);
    hand.read(0.0);
    hand.write({0, 0, 3.0}, 0.0);
    EXPECT_GT(hand.read(0.02).position.z(), 1e-3) << with_body;
    hand.disable();
    hand.disable();
    hand.write({0, 0, 3.0}, 0.02);
    EXPECT_LT(std::abs(hand.read(1.0).position.z()), 3e-3) << "springs back";
    for (int i = 0; i < 20; ++i) hand.read(1.0 + 0.1 * i);
    EXPECT_LT(std::abs(hand.read(3.0).position.z()), 1e-4) << with_body;
    hand.enable();
    hand.write({0, 0, 3.0}, 3.0);
    EXPECT_GT(hand.read(3.05).position.z(), 1e-3) << with_body;
  }
}

TEST(SimulatedHand, TouchesAPlaneByADeviceInALightAndAFirmGrip) {
  const auto cloud = std::make_shared<PointCloud>(test::flat_grid(0.0, 1e-3, 40), Vec3(0, 0, 1));
  const HipPath path({{0.0, Vec3(0, 0, 0.03)}, {2.0, Vec3(0, 0, 0.03)}, {3.0, Vec3(0, 0, -0.004)}});
  for (const char* uri : {"hand:?device=touch&grip=light", "hand:?device=touch&grip=firm",
                          "hand:?device=omega&grip=light", "hand:?device=falcon&grip=firm"}) {
    const auto device = open_device(uri, path);
    Cycle cycle(make_method("paper"), *device);
    auto reader = cycle.reader();
    ServoTick record{};
    for (int i = 0; i < 5000; ++i) {
      const double t = 50.0 + i * ms;
      if (i % 33 == 0) cycle.put_frame(cloud, t, t);
      cycle.run({.t = t});
      ASSERT_TRUE(reader.try_pop(record));
      ASSERT_EQ(record.safety & oscillation_cut, 0U) << uri;
    }
    // Hand and wall share 4 mm, but for friction: k_h (4 mm - d) = K d, within 0.4 N.
    const auto& body = dynamic_cast<SimulatedHand&>(*device).model().body;
    const double k = body ? body->friction : 0.0;
    const double grip = std::string(uri).find("light") != std::string::npos ? 100.0 : 600.0;
    EXPECT_NEAR(record.force.z(), 0.004 * grip * 600.0 / (grip + 600.0), k + 0.05) << uri;
    EXPECT_LT(dynamic_cast<SimulatedHand&>(*device).statistics().shake, 50e-6) << uri;
  }
}

TEST(SimulatedHand, TurnsAsASpringAndDamperDoUnderATorque) {
  DeviceBody body = plain;
  body.inertia = 1e-4;
  HandModel model{.tremor = 0.0, .turn_stiffness = 0.5, .turn_damping = 0.02, .body = body};
  SimulatedHand hand(resting_at(Vec3::Zero()), model);
  const auto angle = [&hand](double t) {
    return rotation_vector(Rotation(*hand.read(t).orientation));
  };
  EXPECT_TRUE(angle(0.0).isZero());
  hand.write(Wrench{Vec3::Zero(), Vec3(0, 0.05, 0)}, 0.0);
  // Overdamped: a slow mode of b/2I - sqrt((b/2I)^2 - k/I) = 29.3 /s, a fast one of 170.7 /s.
  const double slow = 100.0 - std::sqrt(5000.0), fast = 100.0 + std::sqrt(5000.0);
  for (const double t : {0.01, 0.03, 0.1}) {
    const double left = (fast * std::exp(-slow * t) - slow * std::exp(-fast * t)) / (fast - slow);
    EXPECT_LT((angle(t) - Vec3(0, 0.1 * (1.0 - left), 0)).norm(), 1e-3) << t;
  }
  hand.disable();
  EXPECT_LT(angle(0.2).norm(), 0.01) << "springs back";
}

// Leaves what is no number where the next calls have their variables.
[[gnu::noinline]] void spoil_stack() {
  std::array<volatile double, 256> left;
  for (auto& number : left) number = std::numeric_limits<double>::quiet_NaN();
}

TEST(SimulatedHand, TakesEveryForceThatComesWithoutATorque) {
  DeviceBody body = plain;
  body.inertia = 1e-4;
  SimulatedHand one(resting_at(Vec3::Zero()), {.body = body});
  SimulatedHand other(resting_at(Vec3::Zero()), {.body = body});
  Device& device = one;
  for (int i = 0; i < 200; ++i) {
    const double t = i * ms;
    const HandState hand = device.read(t);
    const HandState same = other.read(t);
    ASSERT_EQ(hand.position, same.position) << i;
    ASSERT_EQ(hand.orientation->coeffs(), same.orientation->coeffs()) << i;
    const Vec3 force(0.01 * i, 0, -1);
    spoil_stack();
    device.write(force, t);
    other.write(Wrench{force, Vec3::Zero()}, t);
  }
}

TEST(SimulatedHand, IsTurnedAsItsPathWhereItsHandleDoesNotTurnByItself) {
  const Rotation turned = rotation_by(Vec3(0, 0, 0.8));
  const HipPath path({{0.0, Vec3::Zero(), turned}, {1.0, Vec3::Zero(), turned}});
  EXPECT_FALSE(SimulatedHand(resting_at(Vec3::Zero()), {}).read(0.0).orientation);
  SimulatedHand hand(path, {});
  EXPECT_LT(between(Rotation(*hand.read(0.0).orientation), turned).vec().norm(), 1e-9);
}

// [rad/s] rms, and [N] mean, in the third of three seconds of a tool that is pressed on a plane.
std::pair<double, double> rest_with(const char* shape, const char* grip, bool bounded) {
  constexpr double distance = 0.5;  // [m] of the camera
  constexpr int side = 240;         // [px]
  Eigen::Isometry3d down = Eigen::Isometry3d::Identity();
  down.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  down.translation() = Vec3(0, 0, distance);
  const auto plane = std::make_shared<DepthImage>(
      std::make_shared<ViewingRays>(Intrinsics{
          .width = side, .height = side, .fx = 400, .fy = 400, .cx = 119.5, .cy = 119.5}),
      std::vector<std::uint16_t>(side * side, 5000), 1e4, down);
  const Rotation tilted = rotation_by(Vec3(0, 0.15, 0));
  const Grip& held = grip_preset(grip);
  const double deep = 1.0 / held.stiffness;  // a push of 1 N
  const HipPath path({{0.0, Vec3(0, 0, 0.03), tilted},
                      {0.6, Vec3(0, 0, 0.03), tilted},
                      {1.2, Vec3(0, 0, 0.002 - deep), tilted}});
  const auto device = open_device("hand:?device=sigma&tremor=0&grip=" + std::string(grip), path);
  Parameters parameters;
  if (bounded) set_turn_stiffness(device->info().limits, parameters.coupling);
  ServoSettings settings;
  settings.parameters = parameters;
  Cycle cycle(make_method("sight", parameters, standard_methods(), make_tool(shape, {})), *device,
              settings);
  auto reader = cycle.reader();
  double squares = 0.0, force = 0.0;
  for (int i = 0; i < 3000; ++i) {
    if (i % 33 == 0) cycle.put_frame(plane, i * ms, i * ms);
    cycle.run({.t = i * ms});
    ServoTick record{};
    reader.try_pop(record);
    if (i < 2000) continue;
    squares += std::pow(dynamic_cast<SimulatedHand&>(*device).statistics().turn_rate, 2);
    force += record.force.norm();
  }
  return {std::sqrt(squares / 1000.0), force / 1000.0};
}

// Hazard: torque, fast-oscillation
TEST(SimulatedHand, RestsWithAToolWhoseStiffnessInRotationIsWhatItsDeviceBears) {
  for (const char* grip : {"light", "firm"}) {
    for (const char* shape : {"box:40x20x5mm?points=300", "capsule:200x10mm?points=300"}) {
      const auto [rate, force] = rest_with(shape, grip, true);
      EXPECT_LT(rate, 0.02) << shape << ' ' << grip;
      EXPECT_GT(force, 0.8) << shape << ' ' << grip;
    }
  }
  // What the bound is for: the chain takes half of the force off to end the oscillation.
  const auto [rate, force] = rest_with("capsule:200x10mm?points=300", "light", false);
  EXPECT_GT(rate, 0.2);
  EXPECT_LT(force, 0.8);
}

TEST(OpenDevice, OpensHandsOnDevicesAndSaysWhatTheDeviceIs) {
  const HipPath path = resting_at({1, 2, 3});
  const auto touch = open_device("hand:?device=touch&grip=none", path);
  EXPECT_LT((touch->read(0.0).position - Vec3(1, 2, 3)).norm(), 1e-4);
  EXPECT_EQ(touch->info().kind, "simulated hand on a device: touch");
  EXPECT_EQ(touch->info().limits.continuous_force, 0.88);
  EXPECT_EQ(touch->info().limits.max_stiffness, 500.0);
  const DeviceBody& body = *dynamic_cast<SimulatedHand&>(*touch).model().body;
  EXPECT_EQ(body.mass, 0.06);
  EXPECT_EQ(body.friction, 0.26);
  EXPECT_EQ(body.resolution, 0.055e-3);
  EXPECT_EQ(touch->info().reach->radius, 0.075);
  const auto omega = open_device("hand:?device=omega&grip=firm&friction=0&delay=2ms", path);
  EXPECT_EQ(omega->info().limits.max_force, 12.0);
  EXPECT_EQ(dynamic_cast<SimulatedHand&>(*omega).model().body->friction, 0.0);
  EXPECT_EQ(omega->info().delay, 2e-3);
  EXPECT_FALSE(open_device("hand:?grip=light", path)->info().damping.has_value());

  const auto opening = [&path](const char* uri) {
    return [uri, &path] { return open_device(uri, path) != nullptr; };
  };
  EXPECT_TRUE(
      fails_saying(opening("hand:?device=tuch"), "'tuch'", "none, touch, omega, falcon, sigma"));
  EXPECT_TRUE(fails_saying(opening("hand:?grip=soft"), "'soft'", "light, firm, none"));
  EXPECT_TRUE(fails_saying(opening("hand:?grip=none"), "nothing to move", "device=touch"));
  EXPECT_TRUE(fails_saying(opening("hand:?friction=1"), "'friction'", "device=touch"));
  EXPECT_TRUE(fails_saying(opening("hand:?device=touch&delay=1s"), "'delay'", "out of range"));
}

}  // namespace test_device_body
}  // namespace palpate
