// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"

namespace palpate {
namespace test_proposed_touch {

// Points of a square sheet `side` [m] wide, so far apart as `count` of them lie at random.
std::vector<Vec3> sheet(std::size_t count, double side) {
  std::mt19937 dice(7);
  std::uniform_real_distribution<double> place(-0.5 * side, 0.5 * side);
  std::vector<Vec3> points(count);
  for (Vec3& point : points) point = {place(dice), place(dice), 0.8};
  return points;
}

std::vector<Vec3> times(std::vector<Vec3> points, double factor) {
  for (Vec3& point : points) point *= factor;
  return points;
}

TEST(ProposedTouch, KnowsHowFarApartThePointsOfASheetAre) {
  for (const std::size_t count : {400U, 40'000U}) {
    const double apart = 0.6 / std::sqrt(static_cast<double>(count));
    const ProposedTouch proposed = proposed_touch(PointCloud(sheet(count, 0.6)));
    EXPECT_NEAR(proposed.spacing, apart, 0.25 * apart) << count;
    EXPECT_NEAR(proposed.extent, 0.6, 0.02) << count;
  }
}

TEST(ProposedTouch, TakesPointsThatAreGivenTwiceForOne) {
  std::vector<Vec3> points = sheet(2000, 0.6);
  const double once = proposed_touch(PointCloud(points)).spacing;
  points.insert(points.end(), points.begin(), points.begin() + 2000);
  EXPECT_NEAR(proposed_touch(PointCloud(points)).spacing, once, 0.15 * once);
}

TEST(ProposedTouch, LeavesDensePointsToTheUsualProxy) {
  const ProposedTouch proposed = proposed_touch(PointCloud(sheet(40'000, 0.6)));
  EXPECT_EQ(proposed.radius, ProxyParameters{}.r_c());
  EXPECT_EQ(proposed.scale, 1.0);
}

TEST(ProposedTouch, ProposesAProxyThatSparsePointsCarry) {
  const ProposedTouch proposed = proposed_touch(PointCloud(sheet(3600, 0.6)));  // 10 mm
  EXPECT_GT(proposed.radius, 0.01);
  EXPECT_LT(proposed.radius, 0.02);
  EXPECT_EQ(proposed.scale, 1.0);
}

TEST(ProposedTouch, ProposesALengthOfHalfAMetreForWhatIsTooLargeOrTooSmall) {
  const std::vector<Vec3> points = sheet(40'000, 0.6);
  EXPECT_EQ(proposed_touch(PointCloud(times(points, 1000.0))).scale, 1e-3) << "millimetres";
  EXPECT_EQ(proposed_touch(PointCloud(times(points, 80.0))).scale, 1e-2) << "a house of 48 m";
  EXPECT_EQ(proposed_touch(PointCloud(times(points, 0.005))).scale, 100.0) << "3 mm";
}

TEST(ProposedTouch, SaysNothingOfPointsThatAreTooFew) {
  for (const std::size_t count : {0U, 1U, 8U}) {
    const ProposedTouch proposed = proposed_touch(PointCloud(sheet(count, 0.6)));
    EXPECT_EQ(proposed.spacing, 0.0) << count;
    EXPECT_EQ(proposed.scale, 1.0) << count;
    EXPECT_EQ(proposed.radius, ProxyParameters{}.r_c()) << count;
  }
}

TEST(ProposedTouch, SetsTheRadiiForPointsAndNotForAnImage) {
  const PointCloud sparse(sheet(3600, 0.6));
  const DepthImage image(std::make_shared<ViewingRays>(Intrinsics{
                             .width = 2, .height = 2, .fx = 2, .fy = 2, .cx = 0.5, .cy = 0.5}),
                         std::vector<std::uint16_t>(4, 1000), 1000.0);
  const std::vector<const Cloud*> points{&sparse};
  const ProxyParameters proxy = for_points({}, points).proxy;
  EXPECT_DOUBLE_EQ(proxy.r_c(), proposed_touch(sparse).radius);
  EXPECT_NEAR(proxy.r_3 / proxy.r_c(), 2.0, 1e-9);
  const std::vector<const Cloud*> both{&sparse, &image};
  EXPECT_EQ(for_points({}, both).proxy.r_c(), ProxyParameters{}.r_c());
}

// A mesh of two triangles, and points that must lie on it.
TEST(MeshPoints, LieOnTheFacesEvenlyAndTheSameEachTime) {
  const Surface square{.points = {{0, 0, 1}, {0.1, 0, 1}, {0.1, 0.1, 1}, {0, 0.1, 1}},
                       .triangles = {{0, 1, 2}, {0, 2, 3}}};
  const PointCloud mesh(square);
  EXPECT_NEAR(static_cast<double>(mesh.size()), 4 + 0.01 / 1.5e-3 / 1.5e-3, 2.0);
  EXPECT_EQ(mesh.surface()->points.size(), 4U) << "the file's own";
  double worst = 0.0;  // [m] from a place of the square to the nearest point
  for (int i = 0; i <= 100; i += 2) {
    for (int j = 0; j <= 100; j += 2) {
      double nearest = 1.0;
      for (std::size_t k = 0; k < mesh.size(); ++k)
        nearest = std::min(nearest, (mesh.point(k) - Vec3(1e-3 * i, 1e-3 * j, 1)).norm());
      worst = std::max(worst, nearest);
    }
  }
  EXPECT_LT(worst, 2.5e-3);
  const PointCloud again(square);
  for (std::size_t k = 0; k < mesh.size(); ++k) {
    EXPECT_EQ(mesh.point(k), again.point(k));
    EXPECT_EQ(mesh.point(k).z(), 1.0);
  }
}

TEST(MeshPoints, StayFewOnALargeMeshAndNoneOnABrokenOne) {
  const Surface hall{.points = {{0, 0, 0}, {1000, 0, 0}, {0, 1000, 0}}, .triangles = {{0, 1, 2}}};
  EXPECT_NEAR(static_cast<double>(PointCloud(hall).size()), 1 << 18, 10.0);
  const double far = std::numeric_limits<double>::max();
  const Surface broken{.points = {{0, 0, 0}, {far, 0, 0}, {0, far, 0}, {NAN, 0, 0}},
                       .triangles = {{0, 1, 2}, {0, 1, 3}, {0, 0, 1}}};
  EXPECT_EQ(PointCloud(broken).size(), 3U);
}

}  // namespace test_proposed_touch
}  // namespace palpate
