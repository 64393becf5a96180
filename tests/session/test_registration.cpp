// SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/session/registration.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_registration {

using test::fails_saying;

const std::vector<Vec3> tetrahedron{
    {0.0, 0.0, 0.0}, {0.15, 0.0, 0.01}, {0.02, 0.1, 0.0}, {0.05, 0.05, 0.12}};

Eigen::Isometry3d some_pose(double angle = 2.0) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(angle, Vec3(0.3, -1, 0.5).normalized()).matrix();
  pose.translation() = Vec3(0.4, -0.1, 0.9);
  return pose;
}

// What a device at `pose` reads of points in the scene.
std::vector<PointPair> seen_from(const Eigen::Isometry3d& pose, const std::vector<Vec3>& points,
                                 double scale = 1.0) {
  std::vector<PointPair> pairs;
  for (const Vec3& world : points)
    pairs.push_back({(1.0 / scale * (pose.inverse() * world)).eval(), world});
  return pairs;
}

TEST(FitPlacement, FindsAnExactPoseForAnyRotation) {
  for (double angle = 0.0; angle <= std::numbers::pi + 1e-9; angle += std::numbers::pi / 16) {
    const Eigen::Isometry3d pose = some_pose(angle);
    for (const std::size_t n : {3U, 4U}) {
      const std::vector<Vec3> points(tetrahedron.begin(),
                                     tetrahedron.begin() + static_cast<std::ptrdiff_t>(n));
      const PlacementFit fit = fit_placement(seen_from(pose, points));
      EXPECT_TRUE(fit.placement.world_from_device.isApprox(pose, 1e-9)) << angle << ' ' << n;
      EXPECT_EQ(fit.placement.workspace_scale, 1.0);
      EXPECT_LT(fit.rms, 1e-12);
      EXPECT_EQ(fit.residuals.size(), n);
    }
  }
}

TEST(FitPlacement, FindsTheScaleOrUsesTheOneGiven) {
  const auto pairs = seen_from(some_pose(), tetrahedron, 3.0);
  const PlacementFit fitted = fit_placement(pairs, {.fit_scale = true});
  EXPECT_NEAR(fitted.placement.workspace_scale, 3.0, 1e-9);
  EXPECT_TRUE(fitted.placement.world_from_device.isApprox(some_pose(), 1e-9));
  const PlacementFit given = fit_placement(pairs, {.scale = 3.0});
  EXPECT_TRUE(given.placement.world_from_device.isApprox(some_pose(), 1e-9));
  EXPECT_TRUE(fails_saying([&] { return fit_placement(pairs), 0; }, "3 times", "scale"));
}

TEST(FitPlacement, AveragesNoiseAsLeastSquaresDoes) {
  std::mt19937 random(11);
  std::normal_distribution<double> noise(0.0, 1e-3);
  std::uniform_real_distribution<double> place(-0.1, 0.1);
  std::vector<Vec3> points;
  for (int i = 0; i < 100; ++i) points.emplace_back(place(random), place(random), place(random));
  auto pairs = seen_from(some_pose(), points);
  for (PointPair& pair : pairs) pair.world += Vec3(noise(random), noise(random), noise(random));
  const PlacementFit fit = fit_placement(pairs, {.least_distance = 0.0});
  EXPECT_NEAR(fit.rms, std::sqrt(3.0) * 1e-3, 0.2e-3);
  // 1 mm of noise on 100 points: 0.1 mm an axis, and 0.1 mm over some 0.06 m of rotation.
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_LT((fit.placement.world_from_device * pairs[i].device - points[i]).norm(), 1e-3);
  // No pose nearby does better.
  const auto cost = [&](const Eigen::Isometry3d& pose) {
    double squares = 0.0;
    for (const PointPair& pair : pairs) squares += (pair.world - pose * pair.device).squaredNorm();
    return squares;
  };
  const double least = cost(fit.placement.world_from_device);
  for (int i = 0; i < 50; ++i) {
    Eigen::Isometry3d other = fit.placement.world_from_device;
    other.translation() += 0.1 * Vec3(noise(random), noise(random), noise(random));
    other.rotate(
        Eigen::AngleAxisd(noise(random), Vec3(place(random), place(random), 0.1).normalized()));
    EXPECT_GE(cost(other), least);
  }
}

TEST(FitPlacement, SaysHowFarEachPointIsOff) {
  auto pairs = seen_from(some_pose(), tetrahedron);
  pairs.push_back({some_pose().inverse() * Vec3(0.1, 0.1, 0.1), Vec3(0.1, 0.1, 0.1)});
  pairs[2].world += Vec3(0, 0, 4e-3);  // touched beside it
  const PlacementFit fit = fit_placement(pairs);
  EXPECT_EQ(std::max_element(fit.residuals.begin(), fit.residuals.end()) - fit.residuals.begin(),
            2);
  EXPECT_GT(fit.residuals[2], 1e-3);
}

TEST(FitPlacement, RefusesPointsThatDetermineNoPose) {
  const auto fitting = [](const std::vector<Vec3>& points) {
    return [points] { return fit_placement(seen_from(some_pose(), points)), 0; };
  };
  EXPECT_TRUE(fails_saying(fitting({}), "0 are too few"));
  EXPECT_TRUE(fails_saying(fitting({{0, 0, 0}, {0.1, 0, 0}}), "2 are too few"));
  EXPECT_TRUE(fails_saying(fitting({{0, 0, 0}, {0.1, 0, 0}, {0.2, 0.001, 0}, {0.3, 0, 0}}),
                           "on a line", "triangle"));
  EXPECT_TRUE(fails_saying(fitting({{0, 0, 0}, {0.1, 0, 0}, {0.1, 0.005, 0}}), "points 2 and 3",
                           "5 mm apart"));
  EXPECT_TRUE(fails_saying(fitting({{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0}}),
                           "points 1 and 4", "0 mm"));
  EXPECT_TRUE(fails_saying(
      [] {
        auto pairs = seen_from(some_pose(), tetrahedron);
        pairs[1].device.x() = std::numeric_limits<double>::quiet_NaN();
        return fit_placement(pairs), 0;
      },
      "point 2 is not finite"));
}

TEST(FitPlacement, RefusesUnitsThatDifferAndFramesThatAreMirrored) {
  auto millimetres = seen_from(some_pose(), tetrahedron, 1e-3);
  EXPECT_TRUE(fails_saying([&] { return fit_placement(millimetres), 0; }, "0.001 times", "metres"));
  auto mirrored = seen_from(some_pose(), tetrahedron);
  for (PointPair& pair : mirrored) pair.device.y() *= -1.0;
  EXPECT_TRUE(fails_saying([&] { return fit_placement(mirrored), 0; }, "mirrored", "axes"));
  auto swapped = seen_from(some_pose(), tetrahedron);
  for (PointPair& pair : swapped) std::swap(pair.device.x(), pair.device.y());
  EXPECT_TRUE(fails_saying([&] { return fit_placement(swapped), 0; }, "mirrored"));
}

TEST(ReadPairs, ReadsACsvFileAndNamesFileAndLineOfWhatIsWrong) {
  const test::TemporaryFolder folder;
  const auto good = folder.write(
      "pairs.csv", "wx,wy,wz,dx,dy,dz,note\n1,2,3,0.1,0.2,0.3,a\n\n4,5,6,0.4,0.5,0.6\n");
  const auto pairs = read_pairs(good);
  ASSERT_EQ(pairs.size(), 2U);
  EXPECT_EQ(pairs[1].device, Vec3(0.4, 0.5, 0.6));
  EXPECT_EQ(pairs[0].world, Vec3(1, 2, 3));
  const auto reading = [&](const char* text) {
    const auto file = folder.write("bad.csv", text);
    return [file] { return read_pairs(file), 0; };
  };
  EXPECT_TRUE(fails_saying(reading("dx,dy,dz,wx,wy\n1,2,3,4,5\n"), "bad.csv: line 1:", "'wz'"));
  EXPECT_TRUE(fails_saying(reading("dx,dy,dz,wx,wy,wz\n1,2,3,4,5,x\n"),
                           "bad.csv: line 2:", "wz is not a number"));
  EXPECT_TRUE(
      fails_saying(reading("dx,dy,dz,wx,wy,wz\n1,2,3,4,5\n"), "bad.csv: line 2:", "wz is missing"));
  EXPECT_TRUE(fails_saying(reading("dx,dy,dz,wx,wy,wz\n1,2,nan,4,5,6\n"),
                           "bad.csv: line 2:", "dz is no place"));
  EXPECT_TRUE(fails_saying(reading("dx,dy,dz,wx,wy,wz\n"), "no points"));
  EXPECT_TRUE(fails_saying([&] { return read_pairs(folder.path() / "none.csv"), 0; }, "none.csv",
                           "cannot be read"));
  EXPECT_EQ(read_points(folder.write("points.csv", "x,y,z\n1,2,3\n")).front(), Vec3(1, 2, 3));
}

}  // namespace test_registration
}  // namespace palpate
