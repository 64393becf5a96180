// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/safety.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace test_safety {

using test::fails_saying;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double ms = 1e-3;
constexpr std::uint32_t all = SafetyChain::all_links;

// A hand at rest in contact with a floor, under a camera at 30 Hz; each test changes what it is
// about and looks at what the device gets.
struct Session {
  explicit Session(std::uint32_t links = all, const DeviceLimits& device = {},
                   const SafetyParameters& parameters = {.initial_heat = 0.0})
      : chain(device, parameters, links) {}

  SafetyOutput run(double newtons, double dt = ms) {
    input.t += dt;
    input.force = newtons * Vec3::UnitZ();
    return chain.run(input);
  }
  SafetyOutput run_for(double seconds, double newtons) {
    SafetyOutput output{};
    for (int i = 0; i < std::lround(seconds / ms); ++i) output = run(newtons);
    return output;
  }
  // Passes the gate and the ramp.
  Session& engage() {
    run_for(2.0, 0.0);
    return *this;
  }

  SafetyChain chain;
  SafetyInput input{.t = 100.0,
                    .force = Vec3::Zero(),
                    .hip = {0, 0, -0.01},
                    .proxy = {0, 0, 0.005},
                    .normal = {0, 0, 1},
                    .position = Vec3::Zero(),
                    .hand = true,
                    .frame_age = 0.01,
                    .frame_intervals = 0.3,
                    .surface_velocity = 0.0};
};

// The session behind the gate, with some links left out.
Session engaged_without(std::uint32_t links, const DeviceLimits& device = {}) {
  Session session(all & ~links, device);
  session.engage();
  return session;
}

constexpr DeviceLimits never_hot{.max_force = 3.3, .continuous_force = 3.3};

TEST(SafetyChain, PassesAModestForceOnceEngaged) {
  Session session = engaged_without(0);
  const SafetyOutput output = session.run_for(0.1, 0.8);
  EXPECT_NEAR(output.force.z(), 0.8, 1e-12);
  EXPECT_EQ(output.flags, 0U);
  EXPECT_EQ(output.gain, 1.0);
}

// Hazard: not-a-number
TEST(SafetyChain, AnswersWhatIsNotFiniteWithNoForce) {
  const auto worst = [](std::uint32_t links, auto spoil) {
    Session session = engaged_without(links);
    session.run_for(0.1, 0.8);
    const SafetyInput before = session.input;
    bool finite = true;
    double force = 0.0;
    for (int i = 0; i < 5; ++i) {
      session.input.t = before.t + (i + 1) * ms;
      spoil(session.input);
      const SafetyOutput output = session.chain.run(session.input);
      finite = finite && output.force.allFinite();
      force = output.force.norm();
      EXPECT_EQ((output.flags & input_refused) != 0, links == 0);
    }
    return finite ? force : inf;
  };
  const auto spoil_force = [](SafetyInput& input) { input.force.x() = nan; };
  EXPECT_EQ(worst(0, spoil_force), 0.0);
  EXPECT_EQ(worst(input_refused, spoil_force), inf);
  EXPECT_EQ(worst(0, [](SafetyInput& input) { input.force.y() = inf; }), 0.0);
  EXPECT_EQ(worst(0, [](SafetyInput& input) { input.force.y() = 1e308; }), 0.0);
  EXPECT_EQ(worst(0, [](SafetyInput& input) { input.hip.y() = nan; }), 0.0);
  EXPECT_EQ(worst(0, [](SafetyInput& input) { input.turned.y() = nan; }), 0.0);
  EXPECT_EQ(worst(0, [](SafetyInput& input) { input.proxy.y() = -inf; }), 0.0);
  EXPECT_EQ(worst(0, [](SafetyInput& input) { input.normal.y() = nan; }), 0.0);
  EXPECT_EQ(worst(0, [](SafetyInput& input) { input.position.y() = 1e200; }), 0.0);
  EXPECT_EQ(worst(0, [](SafetyInput& input) { input.t = nan; }), 0.0);
  EXPECT_EQ(worst(0, [](SafetyInput& input) { input.t = inf; }), 0.0);
}

// Hazard: not-a-number
TEST(SafetyChain, TakesTheForceOffWhenTimeRunsBackwards) {
  Session session = engaged_without(0);
  session.run_for(0.1, 0.8);
  EXPECT_TRUE(session.run(0.8, -10.0).flags & input_refused);
  EXPECT_EQ(session.run(0.8).force.norm() < 0.01, true) << "and it ramps from there";
  EXPECT_NEAR(session.engage().run_for(0.1, 0.8).force.norm(), 0.8, 1e-9) << "on the new time";
}

TEST(SafetyChain, TakesTwoTicksAtTheSameTimeForNoFault) {
  Session session = engaged_without(0);
  session.run_for(0.1, 0.8);
  const SafetyOutput again = session.run(0.8, 0.0);
  EXPECT_EQ(again.flags, 0U);
  EXPECT_NEAR(again.force.z(), 0.8, 1e-12);
}

// Hazard: not-a-number
TEST(SafetyChain, GoesOnAfterATimeThatWasNone) {
  Session session = engaged_without(0);
  const double t = session.input.t;
  session.input.t = nan;
  EXPECT_TRUE(session.chain.run(session.input).flags & input_refused);
  session.input.t = t;
  EXPECT_FALSE(session.run(0.0).flags & input_refused) << "later than the last time that was one";
  EXPECT_NEAR(session.engage().run_for(0.1, 0.8).force.norm(), 0.8, 1e-9);
}

// Hazard: pull
TEST(SafetyChain, OnlyPushesAndLeavesWhatIsAlongTheSurface) {
  const auto pulled = [](std::uint32_t links) {
    Session session = engaged_without(links);
    session.input.force = {0.3, 0, -0.5};
    for (int i = 0; i < 20; ++i) {
      session.input.t += ms;
      const SafetyOutput output = session.chain.run(session.input);
      EXPECT_EQ((output.flags & pull_removed) != 0, links == 0);
      if (i == 19) return output.force;
    }
    return Vec3(nan, nan, nan);
  };
  EXPECT_LT((pulled(0) - Vec3(0.3, 0, 0)).norm(), 1e-12);
  EXPECT_LT((pulled(pull_removed) - Vec3(0.3, 0, -0.5)).norm(), 1e-12);
}

TEST(SafetyChain, TellsAPushFromAPullByTheProxyWhereThereIsNoNormal) {
  Session session = engaged_without(0);
  session.input.normal = Vec3::Zero();
  EXPECT_NEAR(session.run_for(0.02, 0.5).force.z(), 0.5, 1e-12);
  EXPECT_EQ(session.run_for(0.02, -0.5).force.z(), 0.0);
  session.input.hip = session.input.proxy;
  EXPECT_EQ(session.run_for(0.02, 0.5).force.z(), 0.0) << "neither is known: no force";
}

// Hazard: pull
TEST(SafetyChain, OnlyPushesWhereTheProxyIsNextToTheHand) {
  Session session = engaged_without(0);
  session.input.proxy = session.input.hip + Vec3(0, 0, 0.5e-3);
  EXPECT_NEAR(session.run_for(0.02, 0.5).force.z(), 0.5, 1e-12);
  EXPECT_NEAR(session.run_for(0.02, -0.5).force.z(), 0.0, 1e-12) << "by the normal";
  session.input.normal = Vec3::Zero();
  EXPECT_NEAR(session.run_for(0.02, 0.5).force.z(), 0.5, 1e-12);
  EXPECT_NEAR(session.run_for(0.02, -0.5).force.z(), 0.0, 1e-12) << "by the proxy alone";
}

// Hazard: pull
TEST(SafetyChain, LetsNoForceActAwayFromTheProxyWhateverTheNormalSays) {
  // The normal leans by 80 degrees from the direction to the proxy, and the force pulls along it.
  Session session = engaged_without(0);
  session.input.normal = {std::sin(1.4), 0, std::cos(1.4)};
  session.input.force = {0.6, 0, -0.3};
  SafetyOutput output{};
  for (int i = 0; i < 20; ++i) {
    session.input.t += ms;
    output = session.chain.run(session.input);
  }
  EXPECT_NEAR(output.force.z(), 0.0, 1e-12);
  EXPECT_NEAR(output.force.x(), 0.6, 1e-12);
  EXPECT_TRUE(output.flags & pull_removed);
}

// Hazard: wrong-direction
TEST(SafetyChain, RefusesANormalThatContradictsTheDirectionToTheProxy) {
  const auto flipped = [](std::uint32_t links, double newtons, double lever) {
    Session session = engaged_without(links | fault_latched);
    session.run_for(0.1, 0.8);
    session.input.normal = {0, 0, -1};
    session.input.proxy = session.input.hip + Vec3(0, 0, lever);
    SafetyOutput output{};
    for (int i = 0; i < 20; ++i) {
      session.input.t += ms;
      session.input.force = {0, 0, newtons};
      output = session.chain.run(session.input);
    }
    return output;
  };
  const SafetyOutput refused = flipped(0, -0.5, 0.015);
  EXPECT_EQ(refused.force.norm(), 0.0);
  EXPECT_TRUE(refused.flags & direction_refused);
  EXPECT_FALSE(flipped(direction_refused, -0.5, 0.015).flags & direction_refused);
  EXPECT_FALSE(flipped(0, -0.04, 0.015).flags & direction_refused) << "a force of no weight";
  EXPECT_FALSE(flipped(0, -0.5, 0.0009).flags & direction_refused) << "a proxy beside the HIP";
  EXPECT_TRUE(flipped(0, -0.5, 0.0011).flags & direction_refused) << "20 counts of an encoder";

  Session session = engaged_without(0);
  session.run_for(0.1, 0.8);
  session.input.normal.z() = -1.0;
  EXPECT_TRUE(session.run(0.8).flags & direction_refused);
  session.input.normal.z() = 1.0;
  EXPECT_EQ(session.run_for(1.0, 0.8).force.norm(), 0.0) << "and the hand has to engage anew";
}

// Hazard: not-a-number
TEST(SafetyChain, EngagesAnewAfterAFault) {
  Session session = engaged_without(0, never_hot);
  session.run_for(0.1, 2.0);
  session.input.proxy.x() = nan;
  EXPECT_TRUE(session.run(2.0).flags & input_refused);
  session.input.proxy.x() = 0.0;
  const SafetyOutput pressed = session.run_for(1.0, 2.0);
  EXPECT_EQ(pressed.force.norm(), 0.0) << "still pressed into the wall";
  EXPECT_EQ(pressed.flags, std::uint32_t{disengaged});
  session.run_for(0.02, 0.0);
  EXPECT_NEAR(session.run_for(2.0, 2.0).force.norm(), 2.0, 1e-9);
}

TEST(SafetyChain, CountsQuietTicksAnewAfterAFault) {
  Session session(all, never_hot);
  for (int i = 0; i < 9; ++i) session.run(0.0);
  session.input.hip.x() = nan;
  session.run(0.0);
  session.input.hip.x() = 0.0;
  for (int i = 0; i < 9; ++i) EXPECT_TRUE(session.run(0.0).flags & disengaged);
  EXPECT_FALSE(session.run(0.0).flags & disengaged);
}

// One tick in `period` is not finite.
void stumble(Session& session, int times, double period) {
  for (int i = 0; i < times; ++i) {
    session.input.hip.x() = nan;
    session.run(0.0);
    session.input.hip.x() = 0.0;
    session.run_for(period - ms, 0.0);
  }
}

// Hazard: repeated-fault
TEST(SafetyChain, LatchesRepeatedFaultsUntilAnOperatorResetsIt) {
  Session session = engaged_without(0, never_hot);
  stumble(session, 2, 0.5);
  EXPECT_EQ(session.chain.latched_by(), 0U);
  stumble(session, 1, 0.5);
  EXPECT_EQ(session.chain.latched_by(), std::uint32_t{input_refused});
  const SafetyOutput output = session.run_for(20.0, 1.0);
  EXPECT_EQ(output.force.norm(), 0.0);
  EXPECT_EQ(output.flags, fault_latched | disengaged);
  session.chain.reset();
  EXPECT_EQ(session.chain.latched_by(), 0U);
  EXPECT_EQ(session.run_for(1.0, 1.0).force.norm(), 0.0) << "the gate is still to be passed";
  session.run_for(0.02, 0.0);
  EXPECT_NEAR(session.run_for(2.0, 1.0).force.norm(), 1.0, 1e-9);
  stumble(session, 2, 0.5);
  EXPECT_EQ(session.chain.latched_by(), 0U) << "faults before the reset are forgotten";
  stumble(session, 1, 0.1);
  EXPECT_NE(session.chain.latched_by(), 0U);
  session.chain.reset();
  stumble(session, 2, 0.1);
  EXPECT_EQ(session.chain.latched_by(), 0U) << "also where they are not 2 s old";
}

TEST(SafetyChain, LatchesForEveryKindOfFaultAndNotForRareOrLongOnes) {
  Session rare = engaged_without(0, never_hot);
  stumble(rare, 20, 1.01);
  EXPECT_EQ(rare.chain.latched_by(), 0U) << "three in 2.02 s";
  stumble(rare, 1, 0.9);
  stumble(rare, 1, 0.5);
  EXPECT_NE(rare.chain.latched_by(), 0U);

  Session lasting = engaged_without(0, never_hot);
  lasting.input.hip.x() = nan;
  lasting.run_for(5.0, 0.0);
  EXPECT_EQ(lasting.chain.latched_by(), 0U) << "one fault, however long";

  Session mixed = engaged_without(0, never_hot);
  stumble(mixed, 2, 0.1);
  mixed.input.normal.z() = -1.0;
  const SafetyOutput third = mixed.run(0.5);
  EXPECT_EQ(third.flags, direction_refused | fault_latched);
  EXPECT_EQ(mixed.chain.latched_by(), input_refused | direction_refused);

  Session once(all, never_hot, {.fault_count = 1.0});
  stumble(once.engage(), 1, 0.1);
  EXPECT_NE(once.chain.latched_by(), 0U);

  Session without = engaged_without(fault_latched, never_hot);
  stumble(without, 10, 0.1);
  EXPECT_EQ(without.chain.latched_by(), 0U);
}

// Hazard: too-much-force
TEST(SafetyChain, CutsTheForceToTheLowerOfTheDevicesAndTheUsersLimit) {
  EXPECT_NEAR(engaged_without(0, never_hot).run_for(0.1, 10.0).force.norm(), 3.3, 1e-9);
  EXPECT_NEAR(engaged_without(force_cut, never_hot).run_for(0.1, 10.0).force.norm(), 10.0, 1e-9);
  Session user(all, {.max_force = 20.0, .continuous_force = 20.0},
               {.max_force = 2.0, .initial_heat = 0.0});
  EXPECT_NEAR(user.engage().run_for(0.1, 10.0).force.norm(), 2.0, 1e-9);
  EXPECT_TRUE(user.run(2.5).flags & force_cut);
  Session device(all, {.max_force = 2.0, .continuous_force = 2.0});
  const SafetyOutput cut = device.engage().run_for(0.1, 2.5);
  EXPECT_NEAR(cut.force.norm(), 2.0, 1e-9);
  EXPECT_TRUE(cut.flags & force_cut) << "and says so";
  EXPECT_FALSE(device.run_for(0.1, 1.9).flags & force_cut);
}

// Hazard: hot-motors
TEST(SafetyChain, ComesDownToTheContinuousForceBeforeTheMotorsAreHot) {
  const auto press = [](std::uint32_t links) {
    Session session = engaged_without(links);
    double heat = 0.0;  // own integration of the mean square
    double hottest = 0.0;
    double first = 0.0;
    double last = 0.0;
    for (int i = 0; i < 60'000; ++i) {
      last = session.run(3.3).force.norm();
      if (i == 500) first = last;
      heat += ms / 20.0 * (last * last - heat);
      hottest = std::max(hottest, heat);
    }
    EXPECT_NEAR(first, 3.3, 1e-9) << "a moment's push is not cut";
    return std::pair(last, std::sqrt(hottest));
  };
  const auto [last, hottest] = press(0);
  EXPECT_NEAR(last, 0.88, 0.01);
  EXPECT_LE(hottest, 0.88 * 1.001);
  EXPECT_NEAR(press(continuous_cut).first, 3.3, 1e-9);
}

// Hazard: hot-motors
TEST(SafetyChain, TakesTheMotorsForWarmAtTheStartUnlessToldOtherwise) {
  const auto pressed_after = [](double seconds, const SafetyParameters& parameters) {
    Session session(all, {}, parameters);
    session.run_for(seconds, 0.0);
    return session.run_for(0.02, 3.3).force.norm();
  };
  SafetyParameters quick;
  quick.ramp_time = 0.01;
  EXPECT_NEAR(pressed_after(0.02, quick), 0.88, 0.05);
  EXPECT_NEAR(pressed_after(20.0 * std::log(1.0 / 0.8) + 0.5, quick), 3.3, 1e-9);
  quick.initial_heat = 0.0;
  EXPECT_NEAR(pressed_after(0.02, quick), 3.3, 1e-9);

  // Half-way from where it begins to come down (80 % of what the motors bear) to the continuous
  // force, half of the heating power between the two is allowed: the square of the force.
  quick.initial_heat = 0.9;
  const double half_warm = pressed_after(0.02, quick);
  EXPECT_NEAR(half_warm * half_warm, 0.5 * (3.3 * 3.3 + 0.88 * 0.88), 0.3);
  quick.initial_heat = 0.0;

  // A session that goes on from the heat of the one before allows what that would have allowed.
  Session before(all, {}, quick);
  before.engage().run_for(1.2, 3.3);
  EXPECT_NEAR(before.chain.heat(), 10.89 / 0.7744 * (1.0 - std::exp(-1.2 / 20.0)), 0.02);
  quick.initial_heat = before.chain.heat();
  Session after(all, {}, quick);
  EXPECT_EQ(after.chain.heat(), quick.initial_heat);
}

TEST(SafetyChain, DoesNotTakeAGapOfTheClockForCooling) {
  Session session(all, {}, {.initial_heat = 1.0});
  session.run(0.0);
  session.run(0.0, 3600.0);
  EXPECT_GT(session.chain.heat(), 0.999);
}

TEST(SafetyChain, GivesTheContinuousForceToMotorsThatAreTooHot) {
  Session session = engaged_without(0);
  session.run_for(0.1, 3.3);
  session.run(3.3, 30.0);  // held all the time, for all that is known
  EXPECT_GT(session.chain.heat(), 2.0);
  EXPECT_NEAR(session.run_for(1.6, 3.3).force.norm(), 0.88, 1e-9);
}

TEST(SafetyChain, ComesDownToALimitThatIsLoweredMeanwhileAtItsFallRate) {
  Session session = engaged_without(0, never_hot);
  session.run_for(0.1, 3.3);
  session.chain.set_parameters({.max_force = 0.5});
  EXPECT_NEAR(session.run(3.3).force.norm(), 1.3, 1e-9);
  EXPECT_NEAR(session.run(3.3).force.norm(), 0.5, 1e-9);
}

// Hazard: force-step
TEST(SafetyChain, RisesNoFasterThanItsSlewLimitAndFallsFaster) {
  const auto steps = [](std::uint32_t links) {
    Session session = engaged_without(links, never_hot);
    std::vector<double> forces;
    for (int i = 0; i < 10; ++i) forces.push_back(session.run(3.0).force.z());
    for (int i = 0; i < 4; ++i) forces.push_back(session.run(0.0).force.z());
    return forces;
  };
  const std::vector<double> limited = steps(0);
  EXPECT_NEAR(limited[0], 0.5, 1e-9);
  EXPECT_NEAR(limited[1], 1.0, 1e-9);
  EXPECT_NEAR(limited[9], 3.0, 1e-9);
  EXPECT_NEAR(limited[10], 1.0, 1e-9) << "2 N/ms towards zero";
  EXPECT_EQ(limited[11], 0.0);
  EXPECT_NEAR(steps(slew_cut)[0], 3.0, 1e-9);

  Session quick = engaged_without(0, never_hot);
  quick.run_for(0.1, 3.0);
  EXPECT_NEAR(quick.run(0.0, 0.5 * ms).force.z(), 2.0, 1e-9) << "1 N in half a millisecond";
}

// Force and torque as one wrench.
constexpr DeviceLimits with_wrist{.max_force = 12.0, .continuous_force = 12.0, .max_torque = 0.4};
constexpr SafetyParameters strong{.max_force = 12.0, .initial_heat = 0.0};

// Hazard: torque
TEST(SafetyChain, SendsNoTorqueToADeviceWithoutMotorsForIt) {
  Session session = engaged_without(0, never_hot);
  session.input.torque = Vec3(0.1, 0, 0);
  const SafetyOutput output = session.run_for(0.1, 0.8);
  EXPECT_TRUE(output.torque.isZero(0.0));
  EXPECT_NEAR(output.force.z(), 0.8, 1e-12);
}

TEST(SafetyChain, PassesAModestTorque) {
  Session session(all, with_wrist, strong);
  session.engage();
  session.input.torque = Vec3(0, 0.05, 0);
  const SafetyOutput output = session.run_for(0.2, 0.8);
  EXPECT_NEAR(output.torque.y(), 0.05, 1e-12);
  EXPECT_EQ(output.flags, 0U);
}

// Hazard: torque
TEST(SafetyChain, ScalesForceAndTorqueByOneFactorAtEitherLimit) {
  for (const auto& [newtons, torque] : {std::pair(24.0, 0.1), std::pair(3.0, 0.8)}) {
    Session session(all, with_wrist, strong);
    session.engage();
    session.input.torque = Vec3(torque, 0, 0);
    const SafetyOutput output = session.run_for(1.0, newtons);
    EXPECT_NEAR(output.force.norm() / newtons, output.torque.norm() / torque, 1e-9);
    EXPECT_NEAR(output.force.norm() / newtons, 0.5, 1e-9);
    EXPECT_NE(output.flags & force_cut, 0U);
    EXPECT_EQ(output.flags & slew_cut, 0U) << "it was cut before it was slewed";
  }
  SafetyParameters half = strong;
  half.max_force = 6.0;
  Session weaker(all, with_wrist, half);
  weaker.engage();
  weaker.input.torque = Vec3(0.8, 0, 0);
  const SafetyOutput output = weaker.run_for(1.0, 3.0);
  EXPECT_NEAR(output.torque.norm(), 0.2, 1e-9) << "as the user's limit of force";
  EXPECT_NEAR(output.force.norm(), 0.25 * 3.0, 1e-9) << "by the same factor";
  // Without the link the torque passes whole.
  Session session(all & ~std::uint32_t{force_cut}, with_wrist, strong);
  session.engage();
  session.input.torque = Vec3(0.8, 0, 0);
  EXPECT_NEAR(session.run_for(1.0, 3.0).torque.norm(), 0.8, 1e-9);
}

// Hazard: torque
TEST(SafetyChain, RampsAndSlewsATorqueAlone) {
  Session session(all, with_wrist, strong);
  session.engage();
  session.input.torque = Vec3(0.2, 0, 0);
  double last = 0.0;
  for (int i = 0; i < 100; ++i) {
    const SafetyOutput output = session.run(0.0);
    const double torque = output.torque.norm();
    EXPECT_TRUE(torque > 0.199 || (output.flags & slew_cut) != 0);
    EXPECT_LE(torque - last, 0.4 / 12.0 * strong.rise_rate * ms + 1e-12);
    last = torque;
  }
  EXPECT_NEAR(last, 0.2, 1e-9);

  // One that turns while it shrinks slowly is longer neither than the limit nor than before.
  SafetyParameters slow = strong;
  slow.rise_rate = 2000.0;
  slow.fall_rate = 100.0;
  Session turning(all, with_wrist, slow);
  turning.engage();
  turning.input.torque = Vec3(0.4, 0, 0);
  EXPECT_NEAR(turning.run_for(1.0, 0.0).torque.norm(), 0.4, 1e-9);
  turning.input.torque = Vec3(0, 0.4, 0);
  EXPECT_LE(turning.run(0.0).torque.norm(), 0.4 + 1e-12);
}

// Hazard: torque
TEST(SafetyChain, EngagesForNoTorqueThatIsAlreadyThere) {
  Session session(all, with_wrist, strong);
  session.input.torque = Vec3(0.1, 0, 0);
  const SafetyOutput output = session.run_for(3.0, 0.0);
  EXPECT_NE(output.flags & disengaged, 0U);
  EXPECT_TRUE(output.torque.isZero(0.0));
  session.input.torque = Vec3::Constant(nan);
  EXPECT_NE(session.run(0.0).flags & input_refused, 0U);
}

// Hazard: torque
TEST(SafetyChain, LetsATorqueOnlyFallOnceAFrameIsLate) {
  Session session(all, with_wrist, strong);
  session.engage();
  session.input.torque = Vec3(0.1, 0, 0);
  session.run_for(0.5, 1.0);
  session.input.frame_intervals = 4.0;
  session.input.torque = Vec3(0.3, 0, 0);
  EXPECT_LE(session.run_for(0.1, 1.0).torque.norm(), 0.1 + 1e-12);
}

// Hazard: torque, fast-oscillation
TEST(SafetyChain, SeesAnOscillationOfTheTorque) {
  for (int axis = 0; axis < 3; ++axis) {
    Session session(all, with_wrist);
    session.engage();
    std::uint32_t flags = 0;
    for (int i = 0; i < 1000; ++i) {
      session.input.torque = ((i / 10) % 2 == 0 ? 0.08 : 0.01) * Vec3::Unit(axis);
      flags |= session.run(0.0).flags;
    }
    EXPECT_TRUE(flags & oscillation_cut) << axis;
  }
}

// Hazard: torque, hot-motors
TEST(SafetyChain, ComesDownToWhatTheWristsMotorsBear) {
  Session session(all, {.max_force = 12.0, .continuous_force = 3.0, .max_torque = 0.4},
                  {.max_force = 12.0, .initial_heat = 0.0});
  session.engage();
  session.input.torque = Vec3(0.3, 0, 0);
  EXPECT_NEAR(session.run_for(0.1, 0.0).torque.norm(), 0.3, 1e-9) << "a moment's turn is not cut";
  const SafetyOutput output = session.run_for(60.0, 0.0);
  EXPECT_TRUE(output.flags & continuous_cut);
  EXPECT_NEAR(output.torque.norm(), 0.4 * 3.0 / 12.0, 0.005);
  EXPECT_NEAR(session.chain.heat(), 1.0, 0.05);
}

// Hazard: torque, slow-oscillation
TEST(SafetyChain, SeesAnOscillationThatTheTorqueKeepsUp) {
  // A wrist that swings by `most` [rad] at 12 Hz on a torsion spring, which answers `late` ticks
  // later. What is left of a torque of 0.1 N m afterwards.
  const auto left_by = [](int late, double most) {
    Session session(all, with_wrist);
    session.engage();
    const auto angle = [most](int tick) {
      return most * std::sin(2.0 * 3.14159265 * 12.0 * ms * tick);
    };
    std::uint32_t flags = 0;
    for (int i = 0; i < 3000; ++i) {
      session.input.turned = (angle(i) - angle(i - 1)) * Vec3::UnitX();
      session.input.torque = 0.09 / most * std::max(-angle(i - late), 0.0) * Vec3::UnitX();
      flags |= session.run(0.0).flags;
    }
    session.input.turned = Vec3::Zero();
    session.input.torque = Vec3(0.1, 0, 0);
    const double left = session.run_for(0.1, 0.0).torque.norm();
    EXPECT_EQ((flags & energy_cut) != 0, left < 0.06) << left;
    return left;
  };
  EXPECT_LT(left_by(10, 0.3), 0.06);
  EXPECT_LT(left_by(10, 0.05), 0.06) << "by 1.7 mm at the lever";
  EXPECT_NEAR(left_by(-1, 0.3), 0.1, 1e-9) << "a spring, and the tick that the device holds it";
}

// Hazard: torque, fast-oscillation
TEST(SafetyChain, SoftensATorqueAloneWhereTheForceOscillated) {
  Session session(all, with_wrist, strong);
  session.engage();
  session.input.torque = Vec3(0.1, 0, 0);
  for (int i = 0; i < 1000; ++i) session.run((i / 10) % 2 == 0 ? 2.8 : 0.3);
  const double softened = session.run_for(0.1, 0.0).torque.norm();
  EXPECT_GT(softened, 0.0);
  EXPECT_LT(softened, 0.06);
  EXPECT_NEAR(session.run_for(3.0, 0.0).torque.norm(), 0.1, 1e-9) << "it recovers";
}

TEST(SafetyChain, TurnsTheForceRoundThroughZeroAndNoFaster) {
  Session session = engaged_without(pull_removed, never_hot);
  session.run_for(0.1, 3.0);
  EXPECT_NEAR(session.run(-3.0).force.z(), 1.0, 1e-9);
  EXPECT_NEAR(session.run(-3.0).force.z(), -0.5, 1e-9);
  EXPECT_NEAR(session.run(-3.0).force.z(), -1.0, 1e-9);
}

// The largest difference of the force in the last of four seconds of a square wave.
double swing_left(std::uint32_t links, double hertz) {
  Session session = engaged_without(links, never_hot);
  double low = inf;
  double high = -inf;
  for (int i = 0; i < 4000; ++i) {
    const bool up = std::fmod(i * ms * hertz, 1.0) < 0.5;
    const double force = session.run(up ? 2.8 : 0.3).force.z();
    if (i < 3000) continue;
    low = std::min(low, force);
    high = std::max(high, force);
  }
  return high - low;
}

// Hazard: fast-oscillation
TEST(SafetyChain, SeesAnOscillationAlongEachAxis) {
  for (int axis = 0; axis < 3; ++axis) {
    Session session = engaged_without(pull_removed, never_hot);
    std::uint32_t flags = 0;
    for (int i = 0; i < 1000; ++i) {
      session.input.t += ms;
      session.input.force = ((i / 10) % 2 == 0 ? 2.8 : 0.3) * Vec3::Unit(axis);
      flags |= session.chain.run(session.input).flags;
    }
    EXPECT_TRUE(flags & oscillation_cut) << axis;
  }
}

// Hazard: fast-oscillation
TEST(SafetyChain, WeakensAFastOscillationAndNotASlowOne) {
  EXPECT_LE(swing_left(0, 50.0), 0.7);  // what is no oscillation, and a little while it recovers
  EXPECT_NEAR(swing_left(oscillation_cut, 50.0), 2.5, 1e-6);
  EXPECT_NEAR(swing_left(0, 3.0), 2.5, 1e-6);
}

// The force is held, changes `count` times by 1 N, 5 ms apart, and is held again.
std::uint32_t flags_of_changes(Session& session, int count) {
  std::uint32_t flags = 0;
  for (int change = 1; change <= count; ++change) {
    for (int i = 0; i < 5; ++i) flags |= session.run(change % 2 != 0 ? 2.0 : 1.0).flags;
  }
  for (int i = 0; i < 100; ++i) flags |= session.run(count % 2 != 0 ? 2.0 : 1.0).flags;
  return flags & oscillation_cut;
}

TEST(SafetyChain, TakesEightFastSwingsInARowForAnOscillationAndNoFewer) {
  // Of n changes the first begins a swing, n - 1 turn round, and n - 2 times that was fast.
  const auto flags_after = [](int changes) {
    Session session = engaged_without(0, never_hot);
    session.run_for(0.2, 1.0);
    return flags_of_changes(session, changes);
  };
  EXPECT_FALSE(flags_after(9));
  EXPECT_TRUE(flags_after(10));
  Session trains = engaged_without(0, never_hot);
  trains.run_for(0.2, 1.0);
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(flags_of_changes(trains, 8)) << "with pauses between";
}

TEST(SafetyChain, TakesAGrainUnderASlidingHandForNoOscillationUpToHalfOfTheForce) {
  const auto flags_with = [](double mean, double swing) {
    Session session = engaged_without(0, never_hot);
    session.run_for(0.2, mean);
    std::uint32_t flags = 0;
    for (int i = 0; i < 1000; ++i) {
      const double vibration = (i / 5) % 2 == 0 ? swing : -swing;
      session.input.vibration = vibration * Vec3::UnitZ();
      flags |= session.run(mean + vibration).flags;
    }
    return flags & oscillation_cut;
  };
  EXPECT_FALSE(flags_with(1.8, 0.55));
  EXPECT_TRUE(flags_with(1.55, 1.25)) << "whatever it is called";
  // Refused, as any force that is no number.
  Session session = engaged_without(0, never_hot);
  session.input.vibration.y() = std::nan("");
  EXPECT_TRUE(session.run(1.0).flags & input_refused);
}

TEST(SafetyChain, SoftensWhatOscillatesAndStillGivesAllTheForceThatIsAllowed) {
  // A gain behind the limit would let a hand of 2 N sink through the surface.
  Session session = engaged_without(0, never_hot);
  for (int i = 0; i < 500; ++i) session.run((i / 10) % 2 == 0 ? 2.8 : 0.3);
  EXPECT_TRUE(session.run(2.0).flags & oscillation_cut);
  EXPECT_NEAR(session.run_for(0.05, 60.0).force.z(), 3.3, 1e-9);
}

TEST(SafetyChain, GivesTheForceBackWhenAnOscillationHasStopped) {
  Session session = engaged_without(0, never_hot);
  int ticks = 0;
  while (!(session.run((ticks / 10) % 2 == 0 ? 2.8 : 0.3).flags & oscillation_cut)) ++ticks;
  EXPECT_LT(ticks, 120) << "8 swings of 10 ms";
  EXPECT_NEAR(session.run_for(0.1, 2.0).force.z(), 1.0, 1e-9);
  EXPECT_NEAR(session.run_for(0.35, 2.0).force.z(), 1.0, 1e-9) << "for half a second";
  EXPECT_NEAR(session.run_for(1.0, 2.0).force.z(), 2.0, 1e-9);
}

// Hazard: engaging-inside
TEST(SafetyChain, EngagesOnlyAfterTheHandFeltNextToNothing) {
  const auto force_after_a_second = [](std::uint32_t links) {
    Session session(all & ~links, never_hot);
    return session.run_for(1.0, 2.0).force.norm();
  };
  EXPECT_EQ(force_after_a_second(0), 0.0) << "a start inside a wall must not kick";
  EXPECT_GT(force_after_a_second(disengaged), 1.0);

  Session session(all, never_hot);
  for (int i = 0; i < 9; ++i) session.run(0.19);
  session.run(0.21);
  EXPECT_EQ(session.run_for(0.5, 2.0).force.norm(), 0.0) << "9 quiet ticks are not 10";
  for (int i = 0; i < 10; ++i) session.run(0.19);
  EXPECT_GT(session.run_for(0.5, 2.0).force.norm(), 0.5);
}

TEST(SafetyChain, CountsNoQuietTicksWhileNobodyHoldsTheDevice) {
  Session session(all, never_hot);
  session.input.hand = false;
  session.run_for(0.1, 0.0);
  session.input.hand = true;
  for (int i = 0; i < 9; ++i) EXPECT_TRUE(session.run(0.0).flags & disengaged) << i;
  EXPECT_FALSE(session.run(0.0).flags & disengaged);
}

TEST(SafetyChain, RampsMoreSlowlyWhereTicksAreFewer) {
  Session session(all, never_hot);
  for (int i = 0; i < 10; ++i) session.run(0.0);
  SafetyOutput output{};
  for (int i = 0; i < 300; ++i) output = session.run(2.0, 4.0 * ms);
  EXPECT_NEAR(output.force.z(), 2.0 * 0.3 / 1.5, 0.01) << "as 300 ticks of a millisecond";
}

// Hazard: engaging-inside
TEST(SafetyChain, RampsTheForceUpAfterEngaging) {
  const auto force_at = [](std::uint32_t links, double seconds) {
    Session session(all & ~links, never_hot);
    for (int i = 0; i < 10; ++i) session.run(0.0);
    return session.run_for(seconds, 2.0).force.norm();
  };
  EXPECT_NEAR(force_at(0, 0.75), 1.0, 0.01);
  EXPECT_NEAR(force_at(0, 1.6), 2.0, 1e-9);
  EXPECT_NEAR(force_at(ramping, 0.01), 2.0, 1e-9);
}

// Hazard: nobody-holds
TEST(SafetyChain, LetsGoOfAHandThatIsGoneAndEngagesAnewWhenItIsBack) {
  Session session = engaged_without(0, never_hot);
  session.run_for(0.1, 2.0);
  session.input.hand = false;
  EXPECT_EQ(session.run_for(0.01, 2.0).force.norm(), 0.0);
  session.input.hand = true;
  EXPECT_EQ(session.run_for(1.0, 2.0).force.norm(), 0.0);
}

TEST(SafetyChain, LetsTheForceOnlyFallOnceAFrameIsLate) {
  const auto extrapolated = [](std::uint32_t links) {
    Session session = engaged_without(links, never_hot);
    session.run_for(0.1, 1.0);
    session.input.frame_intervals = 3.1;
    EXPECT_NEAR(session.run_for(0.01, 0.9).force.z(), 0.9, 1e-9);
    return session.run_for(0.01, 2.0).force.z();
  };
  EXPECT_NEAR(extrapolated(0), 0.9, 1e-9);
  EXPECT_NEAR(extrapolated(force_cut), 0.9, 1e-9) << "whatever the limit";
  EXPECT_NEAR(extrapolated(frame_late), 2.0, 1e-9);
}

TEST(SafetyChain, CallsAFrameLateAfterThreeIntervalsAndNotBefore) {
  Session session = engaged_without(0);
  session.input.frame_intervals = 3.0;
  EXPECT_EQ(session.run(0.5).flags, 0U);
  session.input.frame_intervals = std::nextafter(3.0, 4.0);
  EXPECT_EQ(session.run(0.5).flags, std::uint32_t{frame_late});
  for (const double none : {nan, inf}) {
    session.input.frame_intervals = none;
    EXPECT_TRUE(session.run(0.5).flags & frame_late);
  }
}

// Whatever is asked, from whatever force and in the midst of a ramp: the cap is what was sent.
// Hazard: late-frame
TEST(SafetyChain, NeverSendsMoreThanTheTickBeforeWhileAFrameIsLate) {
  std::mt19937_64 random(5);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  double most_risen = -inf;
  double strongest = 0.0;
  for (int run = 0; run < 200; ++run) {
    SafetyParameters parameters{.initial_heat = 0.0};
    if (run % 2 == 1) parameters.rise_rate = 1e4, parameters.fall_rate = 500.0;
    Session session(all & ~pull_removed, never_hot, parameters);
    session.run_for(0.02, 0.0);
    session.run_for(uniform(0.0, 2.0), uniform(0.0, 3.3));
    session.input.frame_intervals = uniform(3.1, 10.0);
    double last = session.run(1.0).force.norm();
    for (int i = 0; i < 200; ++i) {
      session.input.t += ms;
      session.input.force = {uniform(-1, 1), uniform(-1, 1), uniform(0.0, 5.0)};
      const double force = session.chain.run(session.input).force.norm();
      most_risen = std::max(most_risen, force - last);
      last = force;
      strongest = std::max(strongest, force);
    }
  }
  EXPECT_LE(most_risen, 0.0);
  EXPECT_GT(strongest, 1.0) << "nothing was at stake";
}

TEST(SafetyChain, FadesTheForceAsTheFrameGrowsOld) {
  const auto at_age = [](std::uint32_t links, double age) {
    Session session = engaged_without(links, never_hot);
    session.run_for(0.1, 2.0);
    session.input.frame_age = age;
    return session.run_for(0.01, 2.0).force.z();
  };
  EXPECT_NEAR(at_age(0, 0.1), 2.0, 1e-9);
  EXPECT_NEAR(at_age(0, 0.15), 2.0 * 0.35 / 0.4, 1e-9);
  EXPECT_NEAR(at_age(0, 0.3), 1.0, 1e-9);
  EXPECT_NEAR(at_age(0, 0.499), 0.005, 1e-3);
  EXPECT_NEAR(at_age(frame_fading, 0.3), 2.0, 1e-9);
  Session session = engaged_without(0, never_hot);
  session.input.frame_age = 0.099;
  EXPECT_FALSE(session.run(0.0).flags & frame_fading);
  session.input.frame_age = 0.101;
  EXPECT_TRUE(session.run(0.0).flags & frame_fading);
}

TEST(SafetyChain, DisengagesWhenFramesStayAwayAndIsNotFooledByTheirReturn) {
  const auto after_a_gap = [](std::uint32_t links) {
    Session session = engaged_without(links, never_hot);
    session.run_for(0.1, 2.0);
    session.input.frame_age = 0.6;
    EXPECT_EQ(session.run_for(0.01, 2.0).force.z(), 0.0);
    session.input.frame_age = 0.01;
    return session.run_for(2.0, 2.0).force.z();
  };
  EXPECT_EQ(after_a_gap(0), 0.0);
  EXPECT_NEAR(after_a_gap(frame_lost), 2.0, 1e-9);
}

TEST(SafetyChain, GivesNoForceBeforeTheFirstFrameOrForAnAgeThatIsNone) {
  for (const double age : {inf, nan}) {
    Session session(all & ~frame_fading);
    session.input.frame_age = age;
    session.run_for(0.1, 0.0);
    const SafetyOutput output = session.run_for(2.0, 2.0);
    EXPECT_EQ(output.force.norm(), 0.0);
    EXPECT_TRUE(output.flags & frame_lost);
  }
}

// Hazard: scale-unsure
TEST(SafetyChain, LimitsTheForceSmoothlyWhileTheScaleIsUnsure) {
  Session session = engaged_without(0, never_hot);
  session.run_for(0.1, 3.0);
  session.input.scale_unsure = true;
  double last = 3.0;
  for (int i = 0; i < 400; ++i) {
    const SafetyOutput output = session.run(3.0);
    EXPECT_TRUE(output.flags & scale_unsure);
    EXPECT_LE(output.force.z(), last);
    EXPECT_GT(output.force.z(), last - 0.01) << "no step";
    last = output.force.z();
  }
  EXPECT_NEAR(last, 0.5, 0.01);
  for (int i = 0; i < 1000; ++i) EXPECT_LE(session.run(3.3 * i / 1000).force.norm(), 0.5 + 1e-12);
  EXPECT_NEAR(session.run_for(0.1, 0.3).force.z(), 0.3, 1e-12) << "less than that is felt";
  session.run_for(0.1, 3.0);
  session.input.scale_unsure = false;
  EXPECT_LT(session.run_for(0.75, 3.0).force.z(), 2.0);
  EXPECT_TRUE(session.run(3.0).flags & scale_unsure);
  EXPECT_NEAR(session.run_for(0.76, 3.0).force.z(), 3.0, 1e-9);
  EXPECT_EQ(session.run(3.0).flags, 0U);
  Session without = engaged_without(scale_unsure, never_hot);
  without.input.scale_unsure = true;
  EXPECT_NEAR(without.run_for(1.0, 3.0).force.z(), 3.0, 1e-9);
}

// Hazard: scale-unsure
TEST(SafetyChain, LimitsTorqueFixturesAndRingingWhileTheScaleIsUnsure) {
  Session session(all, with_wrist);
  session.engage();
  session.input.scale_unsure = true;
  session.run_for(1.0, 0.0);
  session.input.torque = Vec3(0.2, 0, 0);
  const double lever = with_wrist.max_torque / with_wrist.max_force;  // [m]
  EXPECT_LE(session.run_for(0.5, 0.0).torque.norm(), 0.5 * lever + 1e-12);
  session.input.torque = Vec3::Zero();
  session.input.transient = Vec3(0, 0, 1);
  EXPECT_LE(session.run_for(0.05, 1.0).force.norm(), 0.5 + 1e-12);
  session.input.transient = Vec3::Zero();
  session.input.region = Vec3(2, 0, 0);
  EXPECT_LE(session.run_for(0.5, 1.0).force.norm(), 0.5 + 1e-12);
  // The weight of a handle has its own.
  session.input.region = Vec3::Zero();
  session.input.held = 1.0;
  EXPECT_NEAR(session.run_for(0.5, 1.0).force.norm(), 0.5, 1e-12);
}

// Hazard: fast-hand
TEST(SafetyChain, TakesTheForceOffAHandThatIsTooFast) {
  const auto moving_at = [](std::uint32_t links, double speed, double dt = ms) {
    Session session = engaged_without(links, never_hot);
    session.run_for(0.1, 2.0);
    double least = inf;
    for (int i = 0; i < 100; ++i) {
      session.input.position.x() += speed * dt;
      least = std::min(least, session.run(2.0, dt).force.z());
    }
    return least;
  };
  EXPECT_EQ(moving_at(0, 2.0), 0.0);
  EXPECT_NEAR(moving_at(0, 1.0), 2.0, 1e-9);
  EXPECT_EQ(moving_at(0, 2.0, 0.25 * ms), 0.0) << "at 4 kHz";
  EXPECT_NEAR(moving_at(0, 1.0, 4.0 * ms), 2.0, 1e-9) << "at 250 Hz";
  EXPECT_NEAR(moving_at(hand_too_fast, 2.0), 2.0, 1e-9);
}

// Hazard: fast-hand
TEST(SafetyChain, TakesAJumpOfTheHandForTooFast) {
  Session session = engaged_without(0, never_hot);
  session.run_for(0.1, 2.0);
  session.input.position.y() += 0.05;
  EXPECT_TRUE(session.run(2.0).flags & hand_too_fast);
  EXPECT_LT(session.run_for(0.003, 2.0).force.z(), 0.01);
}

TEST(SafetyChain, StillKnowsTheHandsSpeedAfterAPositionThatWasNone) {
  Session session = engaged_without(0, never_hot);
  session.input.position.x() = nan;
  session.run(0.0);
  session.input.position.x() = 0.0;
  session.engage();
  session.input.position.y() += 0.05;
  EXPECT_TRUE(session.run(0.0).flags & hand_too_fast);
}

TEST(SafetyChain, DoesNotTakeACountOfACoarseEncoderForSpeed) {
  Session session = engaged_without(0, never_hot);
  session.run_for(0.1, 2.0);
  session.input.position.y() += 2e-3;  // 2 m/s if it were one
  EXPECT_EQ(session.run(2.0).flags, 0U);
}

TEST(SafetyChain, MeasuresTheHandsSpeedOnTheDeviceAndNotInTheScene) {
  const auto flags_of = [](Vec3 SafetyInput::*moving) {
    Session session = engaged_without(direction_refused, never_hot);
    std::uint32_t flags = 0;
    for (int i = 0; i < 100; ++i) {
      (session.input.*moving).x() += 3e-3;
      flags |= session.run(2.0).flags;
    }
    return flags;
  };
  EXPECT_FALSE(flags_of(&SafetyInput::hip) & hand_too_fast);
  EXPECT_TRUE(flags_of(&SafetyInput::position) & hand_too_fast);
}

// Hazard: late-loop
TEST(SafetyChain, RampsFromNothingAfterAStalledTick) {
  const auto after_stall = [](std::uint32_t links) {
    Session session = engaged_without(links, never_hot);
    session.run_for(0.1, 2.0);
    EXPECT_EQ(session.chain.stalls_at(session.input.t + 0.02), links == 0);
    EXPECT_FALSE(session.chain.stalls_at(session.input.t + 0.004));
    session.run(2.0, 0.02);
    return session.run(2.0).force.z();
  };
  EXPECT_LT(after_stall(0), 0.01);
  EXPECT_NEAR(after_stall(stalled), 2.0, 1e-9);
}

TEST(SafetyChain, CountsHowOftenEachLinkStepsIn) {
  Session session = engaged_without(0, never_hot);
  for (int i = 0; i < 3; ++i) {
    session.run_for(0.05, 10.0);
    session.run_for(0.05, 0.0);
  }
  EXPECT_EQ(session.chain.interventions()[2], 3U) << "force_cut is bit 2";
  EXPECT_EQ(session.chain.interventions()[0], 0U);
}

// Hazard: too-much-force
TEST(SafetyChain, KeepsItsPromisesForAnyInput) {
  std::mt19937_64 random(11);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto vector = [&](double size) -> Vec3 {
    switch (random() % 12) {
      case 0:
        return {nan, 0, 0};
      case 1:
        return {0, -inf, 0};
      case 2:
        return {0, 0, 1e308};
      case 3:
        return Vec3::Zero();
      default:
        return {uniform(-size, size), uniform(-size, size), uniform(-size, size)};
    }
  };
  double strongest = 0.0;
  for (int run = 0; run < 20; ++run) {
    Session session(all, {}, {.initial_heat = 0.0, .ramp_time = 0.02});
    SafetyInput& input = session.input;
    Vec3 last = Vec3::Zero();
    for (int i = 0; i < 5000; ++i) {
      const double dt = random() % 300 == 0 ? uniform(-0.1, 0.1) : uniform(0.0, 2e-3);
      const bool time_is_sound = random() % 300 != 0;
      const double t = input.t + dt;
      const bool wild = random() % 60 == 0;
      SafetyInput now{.t = time_is_sound ? t : nan,
                      .force = wild ? vector(50.0) : Vec3(0, 0, uniform(0.0, 5.0)),
                      .hip = wild ? vector(1.0) : Vec3(0, 0, -0.01),
                      .proxy = wild ? vector(1.0) : Vec3(0, 0, 0.005),
                      .normal = wild ? vector(2.0) : Vec3(0, 0, 1),
                      .position = wild ? vector(0.1) : Vec3(0, 0, 0),
                      .hand = random() % 200 != 0,
                      .frame_age = random() % 20 == 0 ? uniform(-1.0, 1.0) : 0.01,
                      .frame_intervals = random() % 20 == 0 ? nan : 0.3,
                      .surface_velocity = random() % 500 == 0 ? nan : uniform(-1, 1)};
      if (i % 1000 < 300) now = input, now.t = t, now.force = Vec3::Zero();  // let it engage
      const SafetyOutput output = session.chain.run(now);
      input.t = t;
      ASSERT_TRUE(output.force.allFinite());
      ASSERT_LE(output.force.norm(), 3.3 + 1e-9);
      ASSERT_LE(output.force.norm() - last.norm(), 0.5 + 1e-9);
      ASSERT_LE((output.force - last).norm(), 2.5 + 1e-9) << "2 N off and 0.5 N on";
      last = output.force;
      strongest = std::max(strongest, last.norm());
    }
  }
  EXPECT_GT(strongest, 3.0) << "the chain was hardly ever engaged";
}

// Hazard: too-much-force, bad-settings
TEST(SafetyChain, StaysWithinItsLimitsWithWhateverParametersAreAllowed) {
  // A force that turns while it may shrink only slowly is neither the old nor the new one.
  Session session(all & ~pull_removed, never_hot,
                  {.initial_heat = 0.0, .rise_rate = 1e5, .fall_rate = 1.0});
  session.engage().run_for(0.1, 3.3);
  for (int i = 0; i < 50; ++i) {
    session.input.t += ms;
    session.input.force = {0, 3.3, 0};
    EXPECT_LE(session.chain.run(session.input).force.norm(), 3.3);
  }
}

// Every combination of states of the chain, extreme parameters and special inputs, one tick each.
// Hazard: not-a-number
TEST(SafetyChain, KeepsItsBoundsFromEveryStateForEverySpecialInput) {
  constexpr double tiny = std::numeric_limits<double>::denorm_min();
  const std::array forces{Vec3(0, 0, 0),       Vec3(0, 0, 3.0),   Vec3(2.0, -2.0, 0.1),
                          Vec3(0, 0, -3.0),    Vec3(0, 0, 1e6),   Vec3(1e308, 0, 0),
                          Vec3(tiny, 0, tiny), Vec3(0, nan, 0.5), Vec3(0, 0, -inf)};
  const std::array times{ms, 0.0, 1e-12, 6 * ms, 1e9, -1.0, nan, inf};
  const std::array ages{0.01, 0.3, 0.5, 0.6, -1.0, inf, nan};
  const std::array intervals{0.3, 3.1, nan};
  const std::array normals{Vec3(0, 0, 1),    Vec3(0, 0, 0),  Vec3(1, 0, 1e-3),
                           Vec3(0, tiny, 0), Vec3(0, 0, -1), Vec3(nan, 0, 0)};
  const std::array levers{0.015, 0.0, -0.002, 1e300};
  std::uint64_t ticks = 0;
  std::uint64_t forceful = 0;
  for (int set = 0; set < 8; set += test::sanitized ? 5 : 1) {
    SafetyParameters parameters{.initial_heat = set % 2 == 0 ? 0.0 : 1.0};
    parameters.rise_rate = (set & 2) != 0 ? 1e5 : 500.0;
    parameters.fall_rate = (set & 4) != 0 ? 1.0 : 2000.0;
    for (int state = 0; state < 6; ++state) {
      Session session(all, {}, parameters);
      if (state > 0) session.run_for(0.02, 0.0);
      if (state == 2) session.run_for(0.7, 1.0);
      if (state > 2) session.run_for(2.0, 3.3);
      if (state == 4) session.input.frame_age = 0.3, session.run_for(0.05, 3.3);
      if (state == 5) {
        session.input.hip.x() = nan;
        for (int i = 0; i < 3; ++i) session.run(3.3);
        session.input.hip.x() = 0.0;
      }
      const Vec3 last = session.run(3.3).force;
      for (const Vec3& force : forces) {
        for (const double dt : times) {
          for (const double age : ages) {
            for (const double late : intervals) {
              for (const Vec3& normal : normals) {
                for (const double lever : levers) {
                  for (const bool hand : {true, false}) {
                    SafetyChain chain = session.chain;
                    SafetyInput input = session.input;
                    input.t += dt;
                    input.force = force;
                    input.frame_age = age;
                    input.frame_intervals = late;
                    input.normal = normal;
                    input.proxy = input.hip + Vec3(0, 0, lever);
                    input.hand = hand;
                    const SafetyOutput output = chain.run(input);
                    const double length = output.force.norm();
                    const double earned = std::isfinite(dt) ? std::clamp(dt, 0.0, ms) : 0.0;
                    ASSERT_TRUE(output.force.allFinite());
                    ASSERT_LE(length, 3.3);
                    ASSERT_LE(length - last.norm(), parameters.rise_rate * earned + 1e-12);
                    ASSERT_LE((output.force - last).norm(),
                              parameters.rise_rate * earned + parameters.fall_rate * ms + 1e-12);
                    ASSERT_TRUE(late <= 3.0 || length <= last.norm());
                    const bool nothing = !hand || !(age <= 0.5) || !(dt >= 0.0 && dt <= 5 * ms) ||
                                         !force.allFinite() || !normal.allFinite();
                    ASSERT_TRUE(!nothing || output.gain == 0.0);
                    ASSERT_EQ(output.flags & output_refused, 0U);
                    ++ticks;
                    if (length > 0.0) ++forceful;
                  }
                }
              }
            }
          }
        }
      }
    }
  }
  EXPECT_GT(ticks, test::sanitized ? 800'000U : 3'000'000U);
  EXPECT_GT(forceful, ticks / 5) << "nothing was at stake";
}

TEST(SafetyParameters, HaveATableThatKnowsEveryOneAndItsDefault) {
  const SafetyParameters defaults;
  std::set<std::string_view> names;
  for (const SafetyParameterInfo& row : safety_parameter_table()) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name;
    EXPECT_EQ(row.get(defaults), row.default_value) << row.name;
    EXPECT_LE(row.min, row.default_value) << row.name;
    EXPECT_LE(row.default_value, row.max) << row.name;
    EXPECT_FALSE(row.meaning.empty() || row.unit.empty()) << row.name;
  }
  EXPECT_EQ(names.size() * sizeof(double), sizeof(SafetyParameters));
  EXPECT_NO_THROW(validate(defaults));
  EXPECT_EQ(safety_flag_table().size(), safety_flag_count);
  std::set<std::string_view> flags;
  for (const FlagInfo& row : safety_flag_table()) {
    EXPECT_TRUE(flags.insert(row.name).second) << row.name;
    EXPECT_GT(row.meaning.size(), 20U) << row.name;
  }
  EXPECT_EQ(safety_flag_table()[std::countr_zero(unsigned{frame_late})].name, "frame_late");
  EXPECT_EQ(flags_in(fault_latched, safety_flag_table()).at(0).name, "fault_latched");
}

// Hazard: bad-settings
TEST(SafetyParameters, AreRefusedByNameAndRange) {
  SafetyParameters parameters;
  set_parameter(parameters, "ramp_time", 1.0);
  EXPECT_EQ(parameters.ramp_time, 1.0);
  const auto set = [&](std::string_view name, double value) {
    return [&parameters, name, value] {
      set_parameter(parameters, name, value);
      return 0;
    };
  };
  EXPECT_TRUE(fails_saying(set("ramp_tim", 1.0), "'ramp_tim'", "did you mean 'ramp_time'?"));
  EXPECT_TRUE(fails_saying(set("rise_rate", -1.0), "'rise_rate'", "out of range"));
  EXPECT_TRUE(fails_saying(set("rise_rate", nan), "'rise_rate'", "out of range"));
  EXPECT_EQ(parameters.rise_rate, 500.0);
  EXPECT_THROW(SafetyChain({}, {.fade_age = 0.5, .lost_age = 0.5}), Error);
  EXPECT_THROW(SafetyChain({.max_force = 0.0}), Error);
}

}  // namespace test_safety
}  // namespace palpate
