// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "palpate/servo/correction_tank.hpp"
#include "palpate/servo/safety.hpp"

namespace palpate {
namespace test_correction_tank {

constexpr double period = 1e-3;  // [s]

// A hand on a spring behind the tank; the force of each tick is held until the next.
struct Bench {
  explicit Bench(double a_frames_work) : frame_work(a_frames_work) {}

  CorrectionTank tank;
  double frame_work;
  double stiffness = 600.0;
  double sent = 0.0;   // [N] up
  double last = 0.0;   // [m] height of the hand
  double given = 0.0;  // [J] to the hand, relative to the surface
  int ticks = 0;
  double least_share = 1.0;

  // Hand and surface at heights, the surface moving as the method tracks it.
  double tick(double hand, double surface, double velocity = 0.0, bool frame = false) {
    given += sent * (ticks++ > 0 ? hand - last - velocity * period : 0.0);
    last = hand;
    const double asked = stiffness * std::max(surface - hand, 0.0);
    const double share = tank.run({.dt = period,
                                   .hip = Vec3(0, 0, hand),
                                   .surface = velocity * Vec3::UnitZ(),
                                   .force = asked * Vec3::UnitZ(),
                                   .last = sent * Vec3::UnitZ(),
                                   .stiffness = stiffness,
                                   .new_frame = frame,
                                   .frame_work = frame_work});
    least_share = std::min(least_share, share);
    return sent = share * asked;
  }
  // From one depth to another, slowly: what the hold makes is nothing.
  void go(double from, double to, double surface = 0.0) {
    for (int i = 0; i <= 2000; ++i) tick(-(from + (to - from) * i / 2000.0), surface);
  }
};

TEST(CorrectionTank, LeavesAnExactSpringAloneAtAnySpeed) {
  for (const double speed : {0.01, 0.1, 1.0}) {
    Bench bench(0.0);
    const double step = speed * period;
    for (double z = 2.5 * step; z > -0.008; z -= step) bench.tick(z, 0.0);
    for (double z = -0.008; z < 3.0 * step; z += step) bench.tick(z, 0.0);
    EXPECT_GT(bench.least_share, 1.0 - 1e-9) << speed;
  }
}

TEST(CorrectionTank, KeepsWhatAFrameGivesTheHandWithinItsLimit) {
  // 4 mm deep, a frame finds the surface 2 mm higher, and the hand goes: 6 mJ, if they were given.
  for (const double limit : {1.0, 1e-3, 1e-4, 0.0}) {
    Bench bench(limit);
    bench.go(0.0, 0.004);
    bench.tick(-0.004, 0.002, 0.0, true);
    bench.go(0.004, -0.003, 0.002);
    EXPECT_NEAR(bench.given, std::min(limit, 6e-3), 2e-5) << limit;
    EXPECT_EQ(bench.sent, 0.0);
  }
}

TEST(CorrectionTank, LetsTheSurfaceComeAsTheNextFramesAllow) {
  Bench bench(1e-4);
  bench.go(0.0, 0.004);
  double before = bench.sent;
  double largest = 0.0;
  int frames = 0;
  while (bench.sent < 600.0 * 0.006 - 1e-6 && frames < 200) {
    bench.tick(-0.004, 0.002, 0.0, true);
    ++frames;
    for (int i = 0; i < 32; ++i) bench.tick(-0.004, 0.002);
    largest = std::max(largest, bench.sent - before);
    before = bench.sent;
  }
  EXPECT_EQ(frames, 60) << "6 mJ at 0.1 mJ a frame";
  EXPECT_LT(largest, 0.03) << "[N] 0.1 mJ at 2.4 N and more";
}

TEST(CorrectionTank, PaysWithWhatWentTheOtherWay) {
  Bench bench(0.0);
  bench.go(0.0, 0.006);
  EXPECT_NEAR(bench.tick(-0.006, -0.001), 3.0, 1e-9);
  EXPECT_NEAR(bench.tank.level(), 0.5 * 600.0 * (36e-6 - 25e-6), 1e-6);
  EXPECT_NEAR(bench.tick(-0.006, 0.0), 3.6, 1e-3) << "it comes back";
  EXPECT_LT(bench.tick(-0.006, 0.001), 3.61) << "but nothing beyond";
  for (int i = 0; i < 30; ++i) bench.tick(0.01, 0.001);
  EXPECT_EQ(bench.tank.level(), 0.0) << "another contact begins with nothing";
}

TEST(CorrectionTank, LimitsAStiffnessThatIsRaisedUnderAHand) {
  Bench bench(0.0);
  bench.go(0.0, 0.004);
  bench.stiffness = 1200.0;
  // 4.8 mJ were pressed in, and 1200 N/m hold as much at 3.4 N.
  EXPECT_NEAR(bench.tick(-0.004, 0.0), std::sqrt(2.0 * 1200.0 * 4.8e-3), 1e-3);
  bench.go(0.004, -0.001);
  EXPECT_LT(bench.given, 2e-5);
}

TEST(CorrectionTank, DoesNotBrakeAnHonestLift) {
  const auto lifted = [](bool tracked) {
    Bench bench(0.0);
    bench.go(0.0, 0.004);
    double height = 0.0;
    for (int i = 0; i < 1000; ++i) {
      height += 0.05 * period;
      // The hand rises with the surface, 4 mm deep.
      bench.tick(height - 0.004, height, tracked ? 0.05 : 0.0);
    }
    return bench.sent;
  };
  EXPECT_NEAR(lifted(true), 2.4, 1e-3) << "the surface moves as it is tracked";
  EXPECT_LT(lifted(false), 0.1) << "the same, were it taken for corrections";
}

TEST(CorrectionTank, DoesNothingWhereTheStiffnessIsNotKnown) {
  Bench bench(0.0);
  bench.stiffness = 0.0;
  bench.tick(-0.004, 0.0);
  EXPECT_EQ(bench.least_share, 1.0);
}

// A hand at rest in a surface that a frame lifts by 3 mm, through the chain.
struct Chained {
  explicit Chained(double frame_work, std::uint32_t links = SafetyChain::all_links)
      : chain({}, parameters(frame_work), links) {}

  static SafetyParameters parameters(double frame_work) {
    SafetyParameters all;
    all.initial_heat = 0.0;
    all.frame_work = frame_work;
    return all;
  }
  SafetyOutput tick(double hand, double surface, bool frame) {
    const Vec3 hip(0, 0, hand);
    const double depth = std::max(surface - hand, 0.0);
    return chain.run({.t = t += period,
                      .force = 600.0 * depth * Vec3::UnitZ(),
                      .hip = hip,
                      .proxy = hip + depth * Vec3::UnitZ(),
                      .normal = Vec3::UnitZ(),
                      .position = hip,
                      .hand = true,
                      .frame_age = 0.01,
                      .frame_intervals = 0.3,
                      .surface_velocity = 0.0,
                      .stiffness = 600.0,
                      .new_frame = frame});
  }
  SafetyOutput press() {
    for (int i = 0; i < 2000; ++i) tick(0.01, 0.0, i % 33 == 0);
    for (int i = 0; i < 200; ++i) tick(0.01 - 6e-5 * i, 0.0, i % 33 == 0);
    return tick(-0.002, 0.002, true);
  }

  SafetyChain chain;
  double t = 0.0;
};

TEST(CorrectionLink, IsOffUnlessItIsAskedFor) {
  Chained by_default(SafetyParameters{}.frame_work);
  Chained without(1e-4, SafetyChain::all_links & ~std::uint32_t{correction_cut});
  const SafetyOutput first = by_default.press();
  EXPECT_EQ(first.flags & correction_cut, 0U);
  EXPECT_GT(first.force.z(), 1.4);
  EXPECT_EQ(first.force, without.press().force);
}

TEST(CorrectionLink, HoldsBackWhatAFrameWouldGive) {
  Chained chained(1e-4);
  const SafetyOutput output = chained.press();
  EXPECT_NE(output.flags & correction_cut, 0U);
  // 1.2 mJ were pressed in: 1.3 mJ on 600 N/m are 1.25 N.
  EXPECT_NEAR(output.force.z(), std::sqrt(2.0 * 600.0 * 1.3e-3), 0.02);
  SafetyOutput last = output;
  for (int i = 0; i < 1800; ++i) last = chained.tick(-0.002, 0.002, i % 33 == 0);
  EXPECT_NEAR(last.force.z(), 2.4, 1e-6) << "in the end the surface is where the camera sees it";
  EXPECT_EQ(last.flags & correction_cut, 0U);
}

}  // namespace test_correction_tank
}  // namespace palpate
