// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/paper/paper.hpp"
#include "palpate/kernel/paper/point_mover.hpp"

#include "tests/support/grids.hpp"

namespace palpate {
namespace test_paper {

using test::flat_grid;
using test::grid;
using test::lowest_rest;

constexpr double r_c = 5e-3;
constexpr double shell = 0.011e-3;  // half the contact shell, and rounding
constexpr double spacing = 1.5e-3;

// Ticks at one place until the proxy rests there.
Tick settle(Paper& paper, const Vec3& hip, double t = 0.0, int ticks = 50) {
  Tick tick = paper.tick(hip, t);
  for (int i = 1; i < ticks; ++i) tick = paper.tick(hip, t + i * 1e-3);
  return tick;
}

TEST(Paper, RestsOneContactRadiusAboveAPlane) {
  const BruteForceCloud plane(flat_grid());
  Paper paper;
  paper.seat({0.0002, 0.0003, 0.02});
  paper.observe({plane, 0.0});
  const Tick tick = settle(paper, {0.0002, 0.0003, -0.010});
  EXPECT_NE(tick.state, ContactState::free_motion);
  EXPECT_GE(tick.proxy.z(), lowest_rest(r_c, spacing) - shell);
  EXPECT_LE(tick.proxy.z(), r_c + shell);
  EXPECT_GT(tick.normal.z(), 0.999);
  // (16): the HIP is 10 mm below the plane and one contact radius is taken off.
  EXPECT_NEAR(tick.force.z(), 600.0 * (tick.proxy.z() + 0.010 - r_c), 1e-3);
}

TEST(Paper, MovesThroughFreeSpaceToTheHipInOneTick) {
  const BruteForceCloud plane(flat_grid());
  Paper paper;
  paper.seat({0, 0, 0.05});
  paper.observe({plane, 0.0});
  const Vec3 hip(0.13, -0.2, 0.31);
  const Tick tick = paper.tick(hip, 0.001);
  EXPECT_LT((tick.proxy - hip).norm(), 1e-9);
  EXPECT_EQ(tick.state, ContactState::free_motion);
  EXPECT_TRUE(tick.force.isZero());
}

TEST(Paper, IsOnTheSurfaceInTheSameTickAsAJumpToSixRadiiBelowIt) {
  const BruteForceCloud plane(flat_grid());
  Paper paper;
  paper.observe({plane, 0.0});
  settle(paper, {0, 0, r_c});
  const Tick tick = paper.tick({0, 0, -6 * r_c}, 1.0);
  EXPECT_GE(tick.proxy.z(), lowest_rest(r_c, spacing) - shell);
  EXPECT_LE(tick.proxy.z(), r_c + shell);
  EXPECT_GT(tick.force.z(), 0.0);
}

TEST(Paper, RestsOnATiltedPlaneAlongItsNormal) {
  const double slope = std::tan(30.0 * std::numbers::pi / 180.0);
  const BruteForceCloud tilt(grid(spacing, 50, [&](double x, double) { return slope * x; }));
  const Vec3 n = Vec3(-slope, 0, 1).normalized();
  Paper paper;
  paper.seat({0, 0, 0.02});
  paper.observe({tilt, 0.0});
  const Vec3 hip = -0.01 * n + Vec3(0, 0.0004, 0);
  const Tick tick = settle(paper, hip);
  // Points lie at most spacing/cos(30) apart along the slope.
  EXPECT_NEAR(tick.proxy.dot(n), r_c, r_c - lowest_rest(r_c, spacing / std::cos(0.5236)) + shell);
  EXPECT_LT((tick.proxy - (hip + (tick.proxy - hip).dot(n) * n)).norm(), 0.8e-3);
  EXPECT_GT(tick.force.normalized().dot(n), 0.998);
}

TEST(Paper, RestsOneContactRadiusOutsideASphere) {
  std::vector<Vec3> points;
  constexpr double radius = 0.04;
  constexpr int count = 12000;
  for (int i = 0; i < count; ++i) {  // Fibonacci sphere, about 1.3 mm apart
    const double z = 1.0 - 2.0 * (i + 0.5) / count;
    const double phi = i * 2.399963229728653;
    const double s = std::sqrt(1.0 - z * z);
    points.emplace_back(radius * s * std::cos(phi), radius * s * std::sin(phi), radius * z);
  }
  const BruteForceCloud sphere(points);
  for (const Vec3& direction : {Vec3(0, 0, 1), Vec3(1, 2, 3), Vec3(-3, 1, 0.4)}) {
    const Vec3 n = direction.normalized();
    Paper paper;
    paper.seat(0.06 * n);
    paper.observe({sphere, 0.0});
    const Tick tick = settle(paper, 0.03 * n);
    EXPECT_NEAR(tick.proxy.norm(), radius + r_c, 0.12e-3);
    EXPECT_GT(tick.proxy.normalized().dot(n), 0.999);
  }
}

TEST(Paper, RestsInAWedgeWhereASphereFits) {
  // Two planes at 45 degrees meet at x = 0: a sphere touches both at height r_c sqrt(2).
  const BruteForceCloud wedge(grid(1e-3, 60, [](double x, double) { return std::abs(x); }));
  Paper paper;
  paper.seat({0.0, 0, 0.03});
  paper.observe({wedge, 0.0});
  const Tick tick = settle(paper, {0.0, 0, -0.01});
  EXPECT_NEAR(tick.proxy.z(), r_c * std::numbers::sqrt2, 0.15e-3);
  EXPECT_NEAR(tick.proxy.x(), 0.0, 0.15e-3);
}

TEST(Paper, PassesAGapWiderThanItselfAndNotANarrowerOne) {
  const auto gap = [](double width) {
    std::vector<Vec3> points;
    for (const Vec3& p : flat_grid(0.0, 1e-3, 40)) {
      if (std::abs(p.x()) >= 0.5 * width) points.push_back(p);
    }
    return BruteForceCloud(points);
  };
  const auto depth_reached = [](const Cloud& cloud) {
    Paper paper;
    paper.seat({0, 0, 0.02});
    paper.observe({cloud, 0.0});
    return settle(paper, {0, 0, -0.02}).proxy.z();
  };
  EXPECT_NEAR(depth_reached(gap(2.2 * r_c)), -0.02, 1e-6);
  // A gap of width w lets a sphere sink until it touches both rims.
  const double w = 6e-3;
  EXPECT_NEAR(depth_reached(gap(w)), std::sqrt(r_c * r_c - 0.25 * w * w), 0.15e-3);
}

TEST(Paper, TurnsTheForceWithTheScene) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<Vec3> points = grid(spacing, 20, [](double x, double y) {
    return 0.002 * std::sin(200 * x) + 0.001 * std::cos(150 * y);
  });
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Quaterniond q =
        Eigen::Quaterniond(uniform(random), uniform(random), uniform(random), uniform(random))
            .normalized();
    const Eigen::Isometry3d turn =
        Eigen::Translation3d(uniform(random), uniform(random), uniform(random)) * q;
    std::vector<Vec3> turned;
    turned.reserve(points.size());
    for (const Vec3& p : points) turned.push_back(turn * p);
    const BruteForceCloud here(points);
    const BruteForceCloud there(turned);
    const Vec3 start(0.01 * uniform(random), 0.01 * uniform(random), 0.02);
    const Vec3 hip(start.x(), start.y(), -0.008);
    Paper a;
    Paper b;
    a.seat(start);
    b.seat(turn * start);
    a.observe({here, 0.0});
    b.observe({there, 0.0});
    const Tick tick_a = settle(a, hip);
    const Tick tick_b = settle(b, turn * hip);
    EXPECT_LT((turn * tick_a.proxy - tick_b.proxy).norm(), 5e-5);
    EXPECT_LT((q * tick_a.force - tick_b.force).norm(), 0.05);
  }
}

TEST(Paper, DoesNotCareInWhichOrderPointsCome) {
  std::vector<Vec3> points = flat_grid();
  const BruteForceCloud ordered(points);
  std::mt19937 random(3);
  std::shuffle(points.begin(), points.end(), random);
  const BruteForceCloud shuffled(points);
  Paper a;
  Paper b;
  a.seat({0.0004, 0.0001, 0.02});
  b.seat({0.0004, 0.0001, 0.02});
  a.observe({ordered, 0.0});
  b.observe({shuffled, 0.0});
  const Tick tick_a = settle(a, {0.0004, 0.0001, -0.01});
  const Tick tick_b = settle(b, {0.0004, 0.0001, -0.01});
  EXPECT_LT((tick_a.proxy - tick_b.proxy).norm(), 2e-5);
  EXPECT_LT((tick_a.force - tick_b.force).norm(), 0.02);
}

TEST(Paper, GivesTheSameTicksBitForBitOnEveryRun) {
  const BruteForceCloud plane(flat_grid());
  const auto run = [&] {
    Paper paper;
    paper.observe({plane, 0.0});
    std::vector<double> out;
    for (int i = 0; i < 400; ++i) {
      if (i % 33 == 0) paper.observe({plane, i * 1e-3});
      const Tick tick = paper.tick({i * 1e-5, 2e-4, 0.01 - i * 5e-5}, i * 1e-3);
      for (int k = 0; k < 3; ++k) out.push_back(tick.force[k]);
      for (int k = 0; k < 3; ++k) out.push_back(tick.proxy[k]);
    }
    return out;
  };
  EXPECT_EQ(run(), run());
}

TEST(Paper, FeelsNothingWhereThereAreNoPoints) {
  const BruteForceCloud empty({});
  Paper paper;
  paper.observe({empty, 0.0});
  const Tick tick = settle(paper, {1, 2, 3});
  EXPECT_TRUE(tick.force.isZero());
  EXPECT_EQ(tick.proxy, Vec3(1, 2, 3));
}

TEST(Paper, FollowsTheHipAndSaysSoBeforeTheFirstFrame) {
  Paper paper;
  const Tick tick = paper.tick({1, 2, 3}, 0.0);
  EXPECT_EQ(tick.proxy, Vec3(1, 2, 3));
  EXPECT_EQ(tick.frame, -1);
  EXPECT_TRUE(tick.flags & no_frame);
  EXPECT_TRUE(tick.force.isZero());
}

TEST(Paper, AnswersANonFiniteHipWithNoForceAndStaysWhereItIs) {
  const BruteForceCloud plane(flat_grid());
  Paper paper;
  paper.seat({0, 0, 0.01});
  paper.observe({plane, 0.0});
  const Tick before = settle(paper, {0, 0, -0.01});
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300}) {
    const Tick tick = paper.tick({0, bad, 0}, 0.1);
    EXPECT_TRUE(tick.flags & non_finite_input);
    EXPECT_TRUE(tick.force.isZero());
    EXPECT_EQ(tick.proxy, before.proxy);
  }
  EXPECT_GT(paper.tick({0, 0, -0.01}, 0.2).force.z(), 0.0);
}

// Hazard: not-a-number, hang
TEST(PointMover, EndsWhereItsWayIsNoNumber) {
  const BruteForceCloud plane(flat_grid());
  PointMover mover({});
  Proxy proxy;
  proxy.at = Vec3(0, 0, 0.01);
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(mover.move(proxy, plane, {0, bad, 0}).steps, 0);
    EXPECT_EQ(*proxy.at, Vec3(0, 0, 0.01));
  }
  EXPECT_TRUE(mover.move(proxy, plane, {0, 0, -0.01}).touched);
}

TEST(Paper, NeverAsksForMoreThanTheForceLimit) {
  const BruteForceCloud plane(flat_grid());
  Parameters parameters;
  parameters.coupling.max_force = 3.3;
  Paper paper(parameters);
  paper.seat({0, 0, 0.02});
  paper.observe({plane, 0.0});
  const Tick tick = settle(paper, {0, 0, -1.0});
  EXPECT_NEAR(tick.force.norm(), 3.3, 1e-9);
  EXPECT_TRUE(tick.flags & force_saturated);
}

TEST(Paper, KeepsItsWorkWithinTheStepBudgetAndSaysWhenItIsSpent) {
  const BruteForceCloud plane(flat_grid(0.0, spacing, 200));
  Parameters parameters;
  parameters.proxy.step_budget = 5;
  Paper paper(parameters);
  paper.seat({0, 0, r_c});
  paper.observe({plane, 0.0});
  const Tick tick = paper.tick({0.1, 0, -0.01}, 0.0);
  EXPECT_EQ(tick.steps, 5);
  EXPECT_TRUE(tick.flags & step_budget_hit);
  EXPECT_GT(tick.force.norm(), 0.0) << "a force must not drop out while the proxy is on its way";
}

TEST(Paper, KeepsTheForceOnWhileSlidingOverASurfaceAtRest) {
  const BruteForceCloud plane(flat_grid(0.0, spacing, 100));
  Paper paper;
  paper.seat({-0.05, 0, 0.02});
  paper.observe({plane, 0.0});
  settle(paper, {-0.05, 0.0003, -0.005});
  for (int i = 0; i < 1000; ++i) {  // 0.1 m/s
    const Tick tick = paper.tick({-0.05 + i * 1e-4, 0.0003, -0.005}, 0.05 + i * 1e-3);
    ASSERT_GT(tick.force.z(), 600.0 * 4.5e-3) << "at tick " << i;
  }
}

// A normal is a mean. A HIP outside of it may yet be behind one of the points that it is the mean
// of, which must not hold the proxy while the HIP goes on.
TEST(Paper, GoesRoundAPointThatStandsInItsWay) {
  constexpr double deviation = 1e-3;  // [m] a Kinect's at 0.8 m
  constexpr double slide = 0.04;      // [m], at 1 m/s
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, deviation);
    const BruteForceCloud rough(grid(spacing, 40, [&](double, double) { return noise(random); }));
    Paper paper;
    paper.seat({-0.5 * slide, 0, 0.02});
    paper.observe({rough, 0.0});
    Tick tick = settle(paper, {-0.5 * slide, 0, 0});
    double farthest = 0.0;
    for (double way = 0.0; way < slide; way += 1e-3) {
      // It leaves along the surface, and is soon higher than the proxy was.
      tick = paper.tick({-0.5 * slide + way, 0, 0.25 * way}, 0.1 + way);
      farthest = std::max(farthest, (tick.proxy - Vec3(way - 0.5 * slide, 0, 0.25 * way)).norm());
    }
    EXPECT_LT(farthest, 2.5 * r_c) << "seed " << seed;
  }
}

TEST(Paper, RefusesRadiiThatDoNotIncrease) {
  Parameters parameters;
  parameters.proxy.r_2 = parameters.proxy.r_1;
  EXPECT_THROW(Paper{parameters}, std::runtime_error);
}

// A surface that rises at a constant velocity, in frames at 30 Hz.
struct Lift {
  std::vector<Tick> ticks;
  std::vector<double> heights;  // of the newest frame's surface at each tick
};

Lift lift(Paper& paper, double velocity, int frames, double f_c = 30.0) {
  std::vector<std::unique_ptr<BruteForceCloud>> clouds;
  Lift result;
  int adopted = -1;
  paper.seat({0.0002, 0.0001, 0.01});
  for (int i = 0; i < frames * 1000 / static_cast<int>(f_c); ++i) {
    const double t = i * 1e-3;
    const int frame = static_cast<int>(std::floor(t * f_c + 1e-9));
    if (frame != adopted) {
      clouds.push_back(std::make_unique<BruteForceCloud>(flat_grid(velocity * frame / f_c)));
      paper.observe({*clouds.back(), frame / f_c});
      adopted = frame;
    }
    // The HIP keeps 30 mm below the true surface.
    result.ticks.push_back(paper.tick({0.0002, 0.0001, velocity * t - 0.03}, t));
    result.heights.push_back(velocity * frame / f_c);
  }
  return result;
}

TEST(Velocity, IsThatOfASurfaceThatRisesSteadily) {
  Paper paper;
  const Lift result = lift(paper, 0.1, 12);
  EXPECT_NEAR(result.ticks.back().surface_velocity, 0.1, 1e-3);
  EXPECT_NEAR(result.ticks.back().proxy.z() - result.heights.back(), r_c, 0.12e-3);
}

TEST(Velocity, CarriesTheProxyWhereTheFixedStepMethodLosesIt) {
  // 0.4 m/s is 13 mm a frame: far more than a radius, reached by a steady acceleration.
  const auto lost = [](Paper::Variant variant) {
    Parameters parameters;
    Paper paper(parameters, variant);
    paper.seat({0, 0, 0.01});
    std::vector<std::unique_ptr<BruteForceCloud>> clouds;
    double height = 0.0;
    double velocity = 0.0;
    Tick tick{};
    for (int frame = 0; frame < 12; ++frame) {
      clouds.push_back(std::make_unique<BruteForceCloud>(flat_grid(height)));
      paper.observe({*clouds.back(), frame / 30.0});
      for (int i = 0; i < 33; ++i)
        tick = paper.tick({0, 0, height - 0.03}, frame / 30.0 + i * 1e-3);
      velocity += 1.5 / 30.0;  // 300 r_c/s^2, below the bound of 898 (14)
      height += velocity / 30.0;
    }
    return tick.proxy.z() < height - velocity / 30.0;
  };
  EXPECT_TRUE(lost(Paper::Variant::fixed_step));
  EXPECT_FALSE(lost(Paper::Variant::corrected));
}

TEST(Erratum15, TheForceBetweenTwoFramesOfASteadyLiftIsARampWithoutAStep) {
  // The HIP rises with the surface, so the force on it ought to be constant; the proxy is carried
  // up in steps and (15) has to fill them in.
  const auto largest_step = [](Paper::Variant variant) {
    Parameters parameters;
    Paper paper(parameters, variant);
    const Lift result = lift(paper, 0.1, 30);
    double step = 0.0;
    for (std::size_t i = result.ticks.size() / 2; i < result.ticks.size(); ++i)
      step = std::max(step, (result.ticks[i].force - result.ticks[i - 1].force).norm());
    return step;
  };
  const double one_frame = 600.0 * 0.1 / 30.0;  // [N] that a frame's travel is worth
  EXPECT_LT(largest_step(Paper::Variant::corrected), 0.02 * one_frame + 0.1);
  EXPECT_GT(largest_step(Paper::Variant::as_printed), 1.8 * one_frame);
}

TEST(Erratum16, ADamperOpposesAHipThatMovesAwayFromTheProxy) {
  const auto force_while_pressing = [](Paper::Variant variant) {
    const BruteForceCloud plane(flat_grid());
    Parameters parameters;
    parameters.coupling.damping = 2.0;
    Paper paper(parameters, variant);
    paper.seat({0, 0, 0.01});
    paper.observe({plane, 0.0});
    Tick tick{};
    for (int i = 0; i <= 100; ++i) tick = paper.tick({0, 0, -1e-4 * i}, i * 1e-3);
    return tick.force.z();  // pressing at 0.1 m/s, 10 mm deep: spring 6 N, damper 0.2 N
  };
  EXPECT_NEAR(force_while_pressing(Paper::Variant::corrected), 6.2, 0.08);
  EXPECT_NEAR(force_while_pressing(Paper::Variant::as_printed), 5.8, 0.08);
}

TEST(Erratum14, TheNoiseFreeBoundIsR1TimesTheFrameRateSquared) {
  // 4.49 m/s^2 = 898 r_c/s^2: held just below, lost just above, from a steady velocity.
  const auto held = [](double acceleration_rc) {
    Paper paper;
    std::vector<std::unique_ptr<BruteForceCloud>> clouds;
    double height = 0.0;
    double velocity = 0.1;
    for (int frame = 0; frame < 22; ++frame) {
      clouds.push_back(std::make_unique<BruteForceCloud>(flat_grid(height)));
      if (frame == 0) paper.seat({0, 0, height + 0.01});
      paper.observe({*clouds.back(), frame / 30.0});
      for (int i = 0; i < 33; ++i) {
        const Tick tick = paper.tick({0, 0, height - 0.03}, frame / 30.0 + i * 1e-3);
        if (tick.proxy.z() < height) return false;
      }
      if (frame >= 12) velocity += acceleration_rc * r_c / 30.0;
      height += velocity / 30.0;
    }
    return true;
  };
  // Nearer to the bound the proxy comes so near to single points that rounding decides.
  EXPECT_TRUE(held(860.0));
  EXPECT_FALSE(held(920.0));
}

TEST(Paper, DerivesNoVelocityFromStampsThatDoNotIncrease) {
  const BruteForceCloud low(flat_grid(0.0));
  const BruteForceCloud high(flat_grid(0.002));
  Paper paper;
  paper.seat({0, 0, 0.01});
  paper.observe({low, 1.0});
  settle(paper, {0, 0, -0.01}, 1.0);
  paper.observe({high, 1.0});
  const Tick tick = paper.tick({0, 0, -0.01}, 1.1);
  EXPECT_TRUE(tick.flags & stamp_not_increasing);
  EXPECT_EQ(tick.surface_velocity, 0.0);
  EXPECT_TRUE(tick.force.allFinite());
}

TEST(Paper, TrustsAVelocityNoLongerThanItIsToldTo) {
  // 0.1 m/s and a second without frames would ask for 60 N.
  Paper paper;
  Lift result = lift(paper, 0.1, 12);
  const double force = result.ticks.back().force.z();
  const Vec3 hip = result.ticks.back().hip;
  const Tick later = paper.tick(hip, result.ticks.back().t + 1.0);
  EXPECT_TRUE(later.flags & frame_stale);
  EXPECT_LT(later.force.z() - force, 600.0 * 0.1 * 0.1 + 0.1);
}

}  // namespace test_paper
}  // namespace palpate
