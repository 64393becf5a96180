// SPDX-License-Identifier: Apache-2.0
// Every method does what its publication claims where it was made for, and fails where it should.
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lab/grid_cloud.hpp"
#include "lab/method.hpp"
#include "palpate/cloud/point_cloud.hpp"

#include "tests/support/grids.hpp"

namespace palpate::lab {
namespace {

constexpr double spacing = 1.5e-3;  // [m] of the points
constexpr double r_c = 5e-3;
constexpr double stiffness = 600.0;
const Vec3 camera(0, 0, 1);

MethodSetup with_flat_truth() {
  return {Parameters{}, [](const Vec3& p, double) { return TruePoint{p.z(), Vec3::UnitZ()}; }};
}

// The hand goes from one place to another at 0.1 m/s, one tick a millisecond.
Tick go(TouchMethod& method, const Vec3& from, const Vec3& to) {
  const int ticks = std::max(1, static_cast<int>((to - from).norm() / 1e-4));
  Tick tick{};
  for (int i = 0; i <= ticks; ++i)
    tick = method.tick(from + (to - from) * (double(i) / ticks), 1e-3 * i);
  return tick;
}

// Onto a cloud from above, and how the hand is held there.
Tick press(TouchMethod& method, const Cloud& cloud, const Vec3& to) {
  method.seat(Vec3(to.x(), to.y(), 0.03));
  method.frame(cloud, 0.0);
  return go(method, Vec3(to.x(), to.y(), 0.03), to);
}

// Where it was held back, as the method has it: on the surface, not r_c above it.
Vec3 contact(const Tick& tick) {
  return tick.proxy - r_c * tick.normal;
}

class EveryMethod : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryMethod, PushesAHandOutOfAPlaneAndLeavesItAloneAbove) {
  const PointCloud plane(test::flat_grid(), camera);
  const auto method = make_method(GetParam(), with_flat_truth());
  const Tick pressed = press(*method, plane, {0.0002, 0.0003, -0.008});
  EXPECT_GT(pressed.force.normalized().z(), 0.99);
  EXPECT_GT(pressed.force.z(), 0.8 * stiffness * 0.008);
  EXPECT_LT(std::abs(contact(pressed).z()), 0.003);
  const Tick left = go(*method, pressed.hip, {0.0002, 0.0003, 0.03});
  EXPECT_TRUE(left.force.isZero());
  EXPECT_LT((left.proxy - left.hip).norm(), 1e-6);
}

TEST_P(EveryMethod, FeelsNothingWithoutAFrameOrPoints) {
  if (GetParam() == "ideal") GTEST_SKIP() << "it needs neither";
  const auto method = make_method(GetParam(), {});
  EXPECT_TRUE(method->tick({0, 0, -0.01}, 0.0).force.isZero());
  const PointCloud nothing({}, camera);
  method->frame(nothing, 0.0);
  const Tick tick = method->tick({0, 0, -0.02}, 0.001);
  EXPECT_TRUE(tick.force.isZero());
  EXPECT_TRUE(tick.proxy.allFinite());
}

TEST_P(EveryMethod, StaysFiniteUnderFiveMillimetresOfNoise) {
  GridCloud grid;
  grid.half_x = grid.half_y = 0.05;
  grid.sigma = 5e-3;
  const auto method = make_method(GetParam(), with_flat_truth());
  std::unique_ptr<PointCloud> in_use;
  for (int frame = 0; frame < 10; ++frame) {
    auto cloud = grid.capture(static_cast<std::uint64_t>(frame), 0.0);
    method->frame(*cloud, frame / 30.0);
    in_use = std::move(cloud);
    for (int i = 0; i < 33; ++i) {
      const double t = (frame + i / 33.0) / 30.0;
      const Tick tick = method->tick({0.01 * t, 0, 0.02 - 0.1 * t}, t);
      ASSERT_TRUE(tick.proxy.allFinite() && tick.normal.allFinite() && tick.force.allFinite());
      ASSERT_LE(tick.force.norm(), 20.0 + 1e-9);
    }
  }
}

std::vector<std::string> all_names() {
  std::vector<std::string> names;
  for (const MethodInfo& method : known_methods()) names.emplace_back(method.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Of, EveryMethod, ::testing::ValuesIn(all_names()), [](const auto& of) {
  std::string name = of.param;
  std::erase(name, '-');
  return name;
});

TEST(PointBoxes, RestsHalfABoxAboveAPlaneThatLiesAsTheAxesDo) {
  const PointCloud plane(test::flat_grid(), camera);
  const auto method = make_method("point-boxes", {});
  const Tick tick = press(*method, plane, {0.0004, 0.0003, -0.008});
  EXPECT_NEAR(contact(tick).z(), 0.8 * spacing, 1e-6);
  EXPECT_NEAR(contact(tick).x(), 0.0004, 1e-6) << "nothing holds it aside";
  EXPECT_NEAR(tick.force.z(), stiffness * (0.008 + 0.8 * spacing), 1e-3);
}

TEST(PointBoxes, CatchesOnTheStairsOfATiltedPlane) {
  const auto tilted = [](double x, double) { return 0.5 * x; };
  const PointCloud plane(test::grid(spacing, 50, tilted), camera);
  const auto method = make_method("point-boxes", {});
  // Uphill along it, 8 mm below: the foot of the hand on the plane is 3.2 mm behind the hand.
  method->seat({-0.02, 0.0, 0.02});
  method->frame(plane, 0.0);
  go(*method, {-0.02, 0.0, 0.02}, {-0.02, 0.0, -0.018});
  const Tick tick = go(*method, {-0.02, 0.0, -0.018}, {0.02, 0.0, 0.002});
  EXPECT_LT(tick.proxy.x(), 0.0) << "it was stopped by a step";
}

TEST(RadialFields, RestsWhereTheFieldsAddUpToT) {
  const PointCloud plane(test::flat_grid(), camera);
  const auto method = make_method("radial-fields", {});
  const Tick tick = press(*method, plane, {0.0, 0.0, -0.008});
  // In the middle of a square grid all R are 2.5 spacings.
  const auto sum = [](double z) {
    double total = 0.0;
    for (int i = -4; i <= 4; ++i) {
      for (int j = -4; j <= 4; ++j) {
        const double q = std::sqrt(i * i * spacing * spacing + j * j * spacing * spacing + z * z) /
                         (2.5 * spacing);
        if (q < 1.0) total += std::pow(1.0 - q, 4) * (4.0 * q + 1.0);
      }
    }
    return total;
  };
  EXPECT_NEAR(sum(contact(tick).z()), 0.05, 1e-3);
  EXPECT_NEAR(contact(tick).z(), 0.71 * 2.5 * spacing, 0.05e-3);
}

TEST(RadialFields, IsLostToASurfaceThatMovesByMoreThanItsShell) {
  // Half the shell is 0.71 R = 2.66 mm. Once the points have passed the proxy, out is down.
  for (const double travel : {2.4e-3, 3.2e-3}) {
    const PointCloud plane(test::flat_grid(), camera);
    const PointCloud risen(test::flat_grid(travel), camera);
    const auto method = make_method("radial-fields", {});
    const Tick before = press(*method, plane, {0.0, 0.0, -0.008});
    method->frame(risen, 1.0 / 30.0);
    const Tick tick = method->tick(before.hip, 0.5);
    EXPECT_EQ(tick.proxy.z() > 0.0, travel < 2.66e-3) << travel;
  }
}

TEST(Surfels, IsExactOnATiltedPlane) {
  const auto tilted = [](double x, double y) { return 0.3 * x - 0.2 * y; };
  const Vec3 normal = Vec3(-0.3, 0.2, 1.0).normalized();
  const PointCloud plane(test::grid(spacing, 50, tilted), camera);
  const auto method = make_method("surfels", {});
  const Vec3 foot(0.002, 0.001, tilted(0.002, 0.001));
  press(*method, plane, foot - 0.002 * normal);
  const Tick tick = go(*method, foot - 0.002 * normal, foot - 0.006 * normal);
  EXPECT_LT(std::acos(std::min(1.0, tick.normal.dot(normal))), 1e-5);
  EXPECT_LT((contact(tick) - foot).norm(), 2e-6);
}

TEST(Surfels, RoundsAnEdgeThatIsSharp) {
  const auto roof = [](double x, double) { return -std::abs(x); };
  const PointCloud edge(test::grid(spacing, 50, roof), camera);
  const auto method = make_method("surfels", {});
  const Tick tick = press(*method, edge, {0.0, 0.0, -0.01});
  EXPECT_LT(contact(tick).z(), -0.5e-3) << "below the edge: it averages over r_3";
}

TEST(Surfels, OverThreeFramesJittersLessAtRestAndLagsBehindWhatMoves) {
  const auto jitter_and_lag = [](const char* name) {
    double squares = 0.0;
    double lag = 0.0;
    for (const bool moves : {false, true}) {
      GridCloud grid;
      grid.sigma = moves ? 0.0 : 1e-3;
      const auto method = make_method(name, {});
      method->seat({0, 0, 0.01});
      std::unique_ptr<PointCloud> in_use;
      for (int k = 0; k < 40; ++k) {
        const double height = moves ? 0.001 * k : 0.0;
        auto cloud = grid.capture(static_cast<std::uint64_t>(k), height);
        method->frame(*cloud, k / 30.0);
        in_use = std::move(cloud);
        for (int i = 0; i < 4; ++i) {
          const Tick tick = method->tick({0, 0, height - 0.02}, (k + i / 4.0) / 30.0);
          if (k < 10 || i < 3) continue;
          const double error = contact(tick).z() - height;
          (moves ? lag : squares) += (moves ? -error : error * error) / 30.0;
        }
      }
    }
    return std::pair{std::sqrt(squares), lag};
  };
  const auto [one_jitter, one_lag] = jitter_and_lag("surfels");
  const auto [few_jitter, few_lag] = jitter_and_lag("surfels-3");
  EXPECT_LT(few_jitter, 0.75 * one_jitter);
  EXPECT_NEAR(one_lag, 0.0, 1e-6);
  EXPECT_NEAR(few_lag, 0.001, 0.1e-3) << "the mean of three frames is one frame old";
}

}  // namespace
}  // namespace palpate::lab
