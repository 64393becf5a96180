// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "palpate/servo/last_gate.hpp"

#include "tests/servo/fake_device.hpp"

namespace palpate {
namespace test_last_gate {

constexpr double ms = 1e-3;  // [s]
constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// A gate, and what a well-behaved session at 1 kHz tells it.
struct Gated {
  LastGate gate;
  test::FakeDevice device;
  palpate_gate_wish wish{};

  Gated() {
    wish.lost_age = 0.5;
    wish.late_intervals = 3.0;
    wish.force_bounds = {3.3, 500.0, 2000.0};
    wish.torque_bounds = {0.1, 15.0, 60.0};
    wish.ramp_time = 1.5;
    wish.longest_gap = 5 * ms;
    wish.longest_time = ms;
    wish.engaged = wish.hand = wish.may_hold = 1;
  }
  Vec3 run(const Vec3& force, double dt = ms) {
    wish.t += dt;
    wish.force = gate_vector(force);
    last = gate.write(device, wish, wish.t);
    return device.force;
  }
  // Until the ramp is at its end.
  void open(const Vec3& force = Vec3::Zero()) {
    for (int i = 0; i < 1600; ++i) run(force);
    EXPECT_EQ(run(force), force);
  }
  LastGate::Sent last{};
};

// Hazard: chain-wrong
TEST(LastGate, SendsToTheBitWhatKeepsTheBounds) {
  Gated session;
  session.open();
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> step(-0.25, 0.25);
  Vec3 force = Vec3::Zero();
  for (int i = 0; i < 10'000; ++i) {
    const Vec3 next = force + Vec3(step(random), step(random), step(random));
    if (next.norm() < 3.3) force = next;
    ASSERT_EQ(session.run(force), force);
    ASSERT_EQ(session.last.verdict, 0);
  }
}

// Hazard: chain-wrong
TEST(LastGate, CutsToTheLimitAndKeepsTheDirection) {
  Gated session;
  for (int i = 0; i < 2000; ++i) session.run(Vec3(0.0, 30.0, 40.0));
  EXPECT_NEAR(session.device.force.norm(), 3.3, 1e-9);
  EXPECT_LE(session.device.force.norm(), 3.3);
  EXPECT_NEAR(session.device.force.y() / session.device.force.z(), 0.75, 1e-12);
  EXPECT_EQ(session.last.verdict, palpate_gate_cut);
}

// Hazard: chain-wrong
TEST(LastGate, AddsInATickOnlyWhatTheRateAllows) {
  Gated session;
  session.open(Vec3(0, 0, 1));
  EXPECT_NEAR(session.run(Vec3(0, 0, 3)).z(), 1.5, 1e-9);
  session.run(Vec3(0, 0, 1.5));
  EXPECT_NEAR(session.run(Vec3(0, 0, -3)).z(), -0.5, 1e-9) << "through zero it is an addition";
  session.run(Vec3(0, 0, 0.4));
  session.run(Vec3(0, 0, 0.8));
  EXPECT_NEAR(session.run(Vec3(3, 0, 0)).x(), 0.5, 1e-9) << "sideways, too";
}

// Hazard: chain-wrong
TEST(LastGate, TakesAForceOffAtOnce) {
  Gated session;
  session.open(Vec3(0, 0, 0));
  for (int i = 1; i <= 7; ++i) session.run(Vec3(0, 0, 0.45 * i));
  EXPECT_EQ(session.device.force.z(), 0.45 * 7);
  EXPECT_EQ(session.run(Vec3::Zero()), Vec3::Zero());
  EXPECT_EQ(session.last.verdict, 0);
}

// Hazard: chain-wrong
TEST(LastGate, AddsForAnImpactWhatItsRingingMayBe) {
  Gated session;
  session.open(Vec3(0, 0, 1));
  session.wish.ring = 0.9;
  EXPECT_EQ(session.run(Vec3(0, 0, 2.3)).z(), 2.3);
  session.wish.ring = 0.0;
  EXPECT_EQ(session.run(Vec3(0, 0, 1.2)).z(), 1.2);
  session.wish.ring = 100.0;
  EXPECT_NEAR(session.run(Vec3(0, 0, 3.3)).z(), 1.2 + 0.5 + 1.0, 1e-9) << "1 N at most";
  session.wish.ring = nan;
  EXPECT_NEAR(session.run(Vec3(0, 0, -2)).z(), -1.5, 1e-9) << "no number: none, but the last's";
}

// Hazard: chain-wrong
TEST(LastGate, NeverSendsMoreWhileAFrameIsLate) {
  Gated session;
  session.open(Vec3(0, 0, 1));
  for (const double intervals : {4.0, inf, nan}) {
    session.wish.frame_intervals = intervals;
    for (int i = 0; i < 100; ++i) {
      const double before = session.device.force.norm();
      EXPECT_LE(session.run(Vec3(0, 0.1 * i, 2)).norm(), before);
    }
  }
  EXPECT_EQ(session.run(Vec3(0, 0, 0.5)).z(), 0.5);
  EXPECT_EQ(session.run(Vec3(0, 0, 0.6)).z(), session.device.force.z());
  EXPECT_LE(session.device.force.z(), 0.5);
  session.wish.frame_intervals = 1.0;
  EXPECT_EQ(session.run(Vec3(0, 0, 0.6)).z(), 0.6);
}

// Hazard: chain-wrong
TEST(LastGate, DoesNotMakeUpForAnImpactWhileItCloses) {
  Gated session;
  session.open(Vec3(0, 0, 1));
  session.wish.ring = 0.9;
  EXPECT_EQ(session.run(Vec3(0, 0, 0.5)).z(), 0.5);
  session.wish.engaged = 0;
  EXPECT_LE(session.run(Vec3(0, 0, 1), 0.2 * ms).z(), 0.5 - 0.399);
}

struct Closing {
  const char* name;
  void (*close)(palpate_gate_wish&);
};

class LastGateCloses : public ::testing::TestWithParam<Closing> {};

// Hazard: chain-wrong
TEST_P(LastGateCloses, WithinTenMillisecondsAndOpensOnlyByTheRamp) {
  Gated session;
  session.wish.force_bounds.fall = 1.0;  // the user's rate is slow; the gate's is not
  session.open();
  for (int i = 1; i <= 7; ++i) session.run(Vec3(0, 0, 0.45 * i));
  const palpate_gate_wish good = session.wish;
  GetParam().close(session.wish);
  session.wish.ring = 1.0;
  double before = session.device.force.z();
  int ticks = 0;
  for (; before > 0.0 && ticks < 100; ++ticks) {
    const double now = session.run(Vec3(0, 0, 3.15)).z();
    EXPECT_TRUE(now == 0.0 || now <= before - 0.329) << now << " after " << before;
    before = now;
  }
  EXPECT_LE(ticks, 10);
  EXPECT_GE(ticks, 9) << "nor faster, as far as the gate goes";
  for (int i = 0; i < 10; ++i) EXPECT_EQ(session.run(Vec3(0, 0, 3.15)), Vec3::Zero());
  const double t = session.wish.t;
  session.wish = good;
  session.wish.t = t;
  for (int i = 1; i <= 1500; ++i) {
    const double allowed = std::min(3.3 * i / 1500.0, 3.15);
    EXPECT_NEAR(session.run(Vec3(0, 0, 3.15)).z(), allowed, 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Reasons, LastGateCloses,
    ::testing::Values(Closing{"disengaged", [](auto& wish) { wish.engaged = 0; }},
                      Closing{"no_hand", [](auto& wish) { wish.hand = 0; }},
                      Closing{"latched", [](auto& wish) { wish.latched = 1; }},
                      Closing{"stale", [](auto& wish) { wish.frame_age = 0.51; }},
                      Closing{"no_frame", [](auto& wish) { wish.frame_age = inf; }},
                      Closing{"no_age", [](auto& wish) { wish.frame_age = nan; }}),
    [](const auto& closing) { return std::string(closing.param.name); });

struct Shutting {
  const char* name;
  void (*spoil)(palpate_gate_wish&);
};

class LastGateShuts : public ::testing::TestWithParam<Shutting> {};

// Hazard: chain-wrong
TEST_P(LastGateShuts, AtOnceAndOpensOnlyByTheRamp) {
  Gated session;
  session.open(Vec3(0, 0, 2));
  session.wish.held = {0, 0, 0.5};
  session.wish.torque = {0.01, 0, 0};
  session.run(Vec3(0, 0, 2));
  EXPECT_EQ(session.device.force.z(), 2.5);
  const palpate_gate_wish good = session.wish;
  GetParam().spoil(session.wish);
  session.last = session.gate.write(session.device, session.wish, 0.0);
  EXPECT_EQ(session.device.force, Vec3::Zero());
  EXPECT_EQ(session.last.wrench.torque, Vec3::Zero());
  EXPECT_EQ(session.last.verdict, palpate_gate_shut);
  const double t = std::abs(session.wish.t) <= 1e12 ? session.wish.t : good.t;
  session.wish = good;
  session.wish.t = t;
  for (int i = 1; i < 100; ++i) {
    EXPECT_LE(session.run(Vec3(0, 0, 2)).z(), 3.4 * i / 1500.0 + i / 1500.0 + 1e-5);
  }
  EXPECT_GT(session.device.force.z(), 0.2);
}

INSTANTIATE_TEST_SUITE_P(
    Reasons, LastGateShuts,
    ::testing::Values(
        Shutting{"clock_stands", [](auto& /*wish*/) {}},
        Shutting{"clock_nearly_stands", [](auto& wish) { wish.t += 0.5e-7; }},
        Shutting{"clock_runs_back", [](auto& wish) { wish.t -= ms; }},
        Shutting{"clock_jumps", [](auto& wish) { wish.t += 5.1 * ms; }},
        Shutting{"no_time", [](auto& wish) { wish.t = nan; }},
        Shutting{"infinite_time", [](auto& wish) { wish.t = inf; }},
        Shutting{"force_x", [](auto& w) { w.t += ms, w.force.x = nan; }},
        Shutting{"force_y", [](auto& w) { w.t += ms, w.force.y = inf; }},
        Shutting{"force_z", [](auto& w) { w.t += ms, w.force.z = -1.1e6; }},
        Shutting{"torque", [](auto& w) { w.t += ms, w.torque.y = nan; }},
        Shutting{"held", [](auto& w) { w.t += ms, w.held.z = -inf; }},
        Shutting{"limit", [](auto& w) { w.t += ms, w.force_bounds.limit = nan; }},
        Shutting{"limit_large", [](auto& w) { w.t += ms, w.force_bounds.limit = 1001.0; }},
        Shutting{"torque_limit", [](auto& w) { w.t += ms, w.torque_bounds.limit = -1.0; }},
        Shutting{"rise", [](auto& w) { w.t += ms, w.force_bounds.rise = inf; }},
        Shutting{"fall", [](auto& w) { w.t += ms, w.force_bounds.fall = nan; }},
        Shutting{"ramp", [](auto& w) { w.t += ms, w.ramp_time = 0.0; }},
        Shutting{"gap", [](auto& w) { w.t += ms, w.longest_gap = inf; }},
        Shutting{"longest_time", [](auto& w) { w.t += ms, w.longest_time = 0.2; }}),
    [](const auto& shutting) { return std::string(shutting.param.name); });

// Hazard: chain-wrong
TEST(LastGate, SendsNothingInItsFirstTick) {
  Gated session;
  EXPECT_EQ(session.run(Vec3(0, 0, 1)), Vec3::Zero());
  EXPECT_EQ(session.last.verdict, palpate_gate_shut);
}

// Hazard: chain-wrong, torque
TEST(LastGate, BoundsATorqueAsAForce) {
  Gated session;
  for (int i = 0; i < 1600; ++i) session.run(Vec3::Zero());
  session.wish.torque = {0.0, 0.01, 0.0};
  session.run(Vec3::Zero());
  EXPECT_EQ(session.last.wrench.torque, Vec3(0.0, 0.01, 0.0));
  session.wish.torque = {0.0, 1.0, 0.0};
  session.run(Vec3::Zero());
  EXPECT_NEAR(session.last.wrench.torque.y(), 0.025, 1e-8) << "0.015 Nm a tick";
  for (int i = 0; i < 10; ++i) session.run(Vec3::Zero());
  EXPECT_NEAR(session.last.wrench.torque.y(), 0.1, 1e-9);
  session.wish.ring = 1.0;
  session.wish.torque = {0.0, -1.0, 0.0};
  session.run(Vec3::Zero());
  EXPECT_NEAR(session.last.wrench.torque.y(), -0.015, 1e-8) << "nothing rings in a torque";
  session.wish.torque_bounds.limit = 0.0;
  for (int i = 0; i < 10; ++i) session.run(Vec3::Zero());
  EXPECT_EQ(session.last.wrench.torque, Vec3::Zero());
}

// Hazard: chain-wrong
TEST(LastGate, ReachesALoweredLimitAtTheRateOfTheUser) {
  Gated session;
  session.wish.force_bounds.fall = 400.0;
  session.open(Vec3::Zero());
  for (int i = 1; i <= 7; ++i) session.run(Vec3(0, 0, 0.45 * i));
  session.wish.force_bounds.limit = 1.0;
  EXPECT_NEAR(session.run(Vec3(0, 0, 3.15)).z(), 2.9, 1e-5);
  EXPECT_NEAR(session.run(Vec3(0, 0, 3.15)).z(), 2.5, 1e-5);
  for (int i = 0; i < 10; ++i) session.run(Vec3(0, 0, 3.15));
  EXPECT_NEAR(session.device.force.z(), 1.0, 1e-5);
}

// Hazard: chain-wrong
TEST(LastGate, HoldsAHandlesWeightBesideTheForceWithinOneNewtonAndTheLimit) {
  Gated session;
  session.wish.engaged = 0;
  session.wish.held = {0.0, 0.0, 0.3};
  for (int i = 0; i < 1600; ++i) session.run(Vec3::Zero());
  EXPECT_EQ(session.device.force.z(), 0.3) << "also of a hand that is not engaged";
  session.wish.held = {0.0, 0.0, 5.0};
  EXPECT_NEAR(session.run(Vec3::Zero()).z(), 1.0, 1e-9);
  session.wish.held = {0.0, 0.0, 0.8};
  session.wish.engaged = 1;
  for (int i = 0; i < 1600; ++i) session.run(Vec3::Zero());
  for (int i = 1; i <= 6; ++i) session.run(Vec3(0, 0, 0.4 * i));
  EXPECT_EQ(session.device.force.z(), 0.4 * 6 + 0.8);
  EXPECT_EQ(session.run(Vec3(0, 0, 2.7)).z(), 2.7) << "the weight yields to the limit";
  session.wish.may_hold = 0;
  EXPECT_EQ(session.run(Vec3(0, 0, 1.0)).z(), 1.0);
  session.wish.may_hold = 1;
  EXPECT_NEAR(session.run(Vec3(0, 0, 1.0)).z(), 1.0 + 1.0 / 1500.0, 1e-6) << "by a ramp";
}

// Hazard: chain-wrong, dead-process
TEST(LastGate, TellsTheDeviceWhatItPassedAndWritesThatAgainOrReleasesIt) {
  Gated session;
  session.open();
  session.wish.held = {0.0, 0.0, 5.0};
  session.wish.torque = {0.0, 0.01, 0.0};
  session.run(Vec3(0.3, 0.0, 0.0));
  EXPECT_EQ(session.device.torque, Vec3(0.0, 0.01, 0.0));
  EXPECT_EQ(vector_of(session.device.wish.force), Vec3(0.3, 0.0, 0.0));
  EXPECT_NEAR(session.device.wish.held.z, 1.0, 1e-9) << "not what was asked for";
  const Vec3 force = session.device.force;
  EXPECT_EQ(force, Vec3(0.3, 0.0, session.device.wish.held.z));
  session.device.force = session.device.torque = Vec3::Zero();
  session.gate.write_again(session.device, session.wish.t);
  EXPECT_EQ(session.device.force, force);
  EXPECT_EQ(session.device.torque, Vec3(0.0, 0.01, 0.0));

  session.gate.release(session.device, session.wish.t);
  EXPECT_EQ(session.device.force, Vec3(0.0, 0.0, 0.0));
  EXPECT_EQ(session.run(Vec3(0.3, 0.0, 0.0)), Vec3(0.0, 0.0, 0.0)) << "it starts again";
  EXPECT_LT(session.run(Vec3(0.3, 0.0, 0.0)).norm(), 0.01) << "by the ramp";
}

}  // namespace test_last_gate
}  // namespace palpate
