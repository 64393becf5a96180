// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>

#include "palpate/servo/safety.hpp"
#include "palpate/servo/transient_budget.hpp"

namespace palpate {
namespace test_transient_budget {

constexpr double dt = 1e-3;
constexpr double up = 1.0;

// Hazard: impact
TEST(TransientBudget, LetsAnImpactRingAtOnceAndBriefly) {
  TransientBudget budget;
  const Vec3 hip = Vec3::Zero();
  int ticks = 0;
  for (int i = 0; i < 95; ++i) {
    const Vec3 allowed = budget.run(i * dt, hip, Vec3(0, 0, 0.7));
    if (i <= 60) {
      EXPECT_EQ(allowed, Vec3(0, 0, 0.7)) << i;
    }
    ticks += allowed.isZero() ? 0 : 1;
  }
  EXPECT_EQ(ticks, 61);
  EXPECT_EQ(budget.run(0.11, hip, Vec3(0, 0, up)), Vec3(0, 0, up)) << "the next impact";
}

// Hazard: impact
TEST(TransientBudget, CutsWhatIsTooStrongOrDoesTooMuchWork) {
  TransientBudget budget;
  EXPECT_NEAR(budget.run(0.0, Vec3::Zero(), Vec3(3, 0, 4)).norm(), 1.0, 1e-12);
  // A handle that runs away with it: 1 N over 5 mm.
  const Vec3 along(0.6, 0, 0.8);
  constexpr double step = 0.5e-3;
  double given = 0.0;
  Vec3 force = along;
  for (int i = 1; i < 50 && !force.isZero(); ++i) {
    given += step * force.dot(along);
    force = budget.run(i * dt, Vec3(i * step * along), along);
  }
  EXPECT_LE(given, TransientBudget::work + 1.01 * 0.5e-3);
  EXPECT_GT(given, 0.8 * TransientBudget::work);
}

// A hand that is engaged and touches a floor.
struct Touching {
  Touching() : chain(DeviceLimits{}, SafetyParameters{.initial_heat = 0.0}) {
    input.t = 100.0;
    input.force = Vec3::Zero();
    input.hip = Vec3(0, 0, -0.01);
    input.proxy = Vec3(0, 0, 0.005);
    input.normal = Vec3(0, 0, 1);
    input.position = Vec3::Zero();
    input.hand = true;
    input.frame_age = 0.01;
    input.frame_intervals = 0.3;
    for (int i = 0; i < 2000; ++i) run(0.0, 0.0);
    for (int i = 0; i < 50; ++i) run(1.0, 0.0);
  }
  SafetyOutput run(double newtons, double ringing) {
    input.t += dt;
    input.transient = ringing * Vec3::UnitZ();
    input.force = newtons * Vec3::UnitZ() + input.transient;
    return chain.run(input);
  }
  SafetyChain chain;
  SafetyInput input{};
};

// Hazard: impact
TEST(TransientBudget, IsNotMadeUpForByAForceThatEnds) {
  Touching hand;
  EXPECT_NEAR(hand.run(1.0, -0.6).force.z(), 0.4, 1e-9);
  hand.input.hand = false;
  EXPECT_EQ(hand.run(1.0, 0.0).force.z(), 0.0);
  Touching slow;
  slow.run(1.0, -0.6);
  slow.input.hand = false;
  slow.input.t -= 0.9 * dt;
  EXPECT_NEAR(slow.run(1.0, 0.0).force.z(), 0.4 - 2000.0 * 0.1 * dt, 1e-9);
}

// Hazard: impact
TEST(TransientBudget, IsBesideTheLimitOfTheRise) {
  Touching hand;
  EXPECT_NEAR(hand.run(1.0, 0.9).force.z(), 1.9, 1e-9);
  EXPECT_NEAR(hand.run(1.0, -0.9).force.z(), 0.1, 1e-9);
  EXPECT_EQ(hand.run(0.2, -0.9).force.z(), 0.0) << "a surface does not pull";
  EXPECT_NEAR(hand.run(1.0, 0.0).force.z(), 0.7, 0.31) << "the lasting force rises as ever";
}

// Hazard: impact, material-force
TEST(TransientBudget, KeepsTheLimitsOfTheForce) {
  Touching hand;
  for (int i = 0; i < 50; ++i) hand.run(3.2, 0.0);
  const SafetyOutput output = hand.run(3.2, 1.0);
  EXPECT_LE(output.force.norm(), 3.3);
  EXPECT_TRUE(output.flags & force_cut);
}

// Hazard: impact, engaging-inside
TEST(TransientBudget, IsRampedAsTheForce) {
  Touching hand;
  hand.input.hand = false;
  hand.run(0.0, 0.0);
  hand.input.hand = true;
  for (int i = 0; i < 300; ++i) hand.run(0.0, 0.0);
  const SafetyOutput output = hand.run(1.0, 0.9);
  EXPECT_GT(output.gain, 0.1);
  EXPECT_LT(output.gain, 0.5);
  EXPECT_NEAR(output.ring, output.gain * 0.9, 1e-9);
}

// Hazard: impact, late-frame
TEST(TransientBudget, IsNotReplacedByALastingForceWhileAFrameIsLate) {
  Touching hand;
  ASSERT_NEAR(hand.run(1.0, 0.9).force.z(), 1.9, 1e-9);
  hand.input.frame_intervals = 9.0;
  EXPECT_LE(hand.run(3.0, 0.0).force.norm(), 1.0 + 1e-9);
}

// Hazard: impact
TEST(TransientBudget, IsNothingWhileSomethingIsAmiss) {
  const auto rings = [](const auto& amiss) {
    Touching hand;
    amiss(hand.input);
    return hand.run(1.0, 1.0).force.z() > 1.0 + 1e-9;
  };
  EXPECT_TRUE(rings([](SafetyInput&) {}));
  EXPECT_FALSE(rings([](SafetyInput& input) { input.hand = false; }));
  EXPECT_FALSE(rings([](SafetyInput& input) { input.frame_age = 1.0; }));
  EXPECT_FALSE(rings([](SafetyInput& input) { input.frame_intervals = 9.0; }));
  EXPECT_FALSE(rings([](SafetyInput& input) { input.normal = -input.normal; }));
  EXPECT_FALSE(rings([](SafetyInput& input) { input.t += 0.01; })) << "a stall";
  EXPECT_FALSE(rings([](SafetyInput& input) { input.hip.x() = std::nan(""); }));
  // A ringing that is no number is a fault as any.
  Touching hand;
  hand.input.t += dt;
  hand.input.force = Vec3(0, 0, 1);
  hand.input.transient = Vec3(0, std::nan(""), 0);
  EXPECT_TRUE(hand.chain.run(hand.input).flags & input_refused);
}

}  // namespace test_transient_budget
}  // namespace palpate
