// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/organised.hpp"
namespace palpate {
namespace test_organised {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
const Intrinsics camera{.width = 80, .height = 60, .fx = 70.0, .fy = 71.5, .cx = 38.25, .cy = 31.0};

// What the camera sees of a wavy wall at 1 m, with a hole in every seventh place.
std::vector<Vec3> seen_from(const Eigen::Isometry3d& pose, bool wavy = true) {
  std::vector<Vec3> points;
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const double z = wavy ? 1.0 + 0.3 * std::sin(0.2 * u) * std::cos(0.15 * v) : 1.0 + 0.004 * u;
      const Vec3 p((u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z);
      points.push_back(points.size() % 7 == 3 ? Vec3(nan, nan, nan) : Vec3(pose * p));
    }
  }
  return points;
}

Eigen::Isometry3d turned(const Vec3& at) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = (Eigen::AngleAxisd(-1.9, Vec3(1.0, 0.4, -0.3).normalized()) *
                   Eigen::AngleAxisd(0.8, Vec3::UnitZ()))
                      .toRotationMatrix();
  pose.translation() = at;
  return pose;
}

void expect_same(const GridCamera& fitted, const Eigen::Isometry3d& pose,
                 const std::vector<Vec3>& points) {
  const Intrinsics& k = fitted.rays->intrinsics();
  EXPECT_NEAR(k.fx, camera.fx, 1e-5);
  EXPECT_NEAR(k.fy, camera.fy, 1e-5);
  EXPECT_NEAR(k.cx, camera.cx, 1e-5);
  EXPECT_NEAR(k.cy, camera.cy, 1e-5);
  EXPECT_TRUE(fitted.world_from_camera.isApprox(pose, 1e-6));
  const auto image = depth_image_of(points, fitted);
  ASSERT_NE(image, nullptr);
  for (int v = 0, i = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u, ++i) {
      const auto point = image->deproject(u, v);
      const Vec3& given = points[static_cast<std::size_t>(i)];
      ASSERT_EQ(point.has_value(), given.allFinite());
      // Half a unit of depth, along a ray that is at most 1.2 as long as its depth.
      if (!point) continue;
      ASSERT_LT((*point - given).norm(), 0.6 / image->units_per_metre() + 1e-6);
    }
  }
}

TEST(OrganisedClouds, AreDepthImagesOfTheCameraThatIsFittedToThem) {
  const auto points = seen_from(Eigen::Isometry3d::Identity());
  const auto fitted = fit_camera(points, camera.width, camera.height, std::nullopt);
  ASSERT_TRUE(fitted.has_value());
  expect_same(*fitted, Eigen::Isometry3d::Identity(), points);
  EXPECT_EQ(depth_image_of(points, *fitted)->units_per_metre(), 5e4) << "0.02 mm, up to 1.31 m";
}

TEST(OrganisedClouds, InAnotherFrameTellWhereTheirCameraStood) {
  for (const Vec3& at : {Vec3(0.0, 0.0, 0.0), Vec3(3.0, -2.0, 1.5)}) {
    const Eigen::Isometry3d pose = turned(at);
    const auto points = seen_from(pose);
    const auto fitted = fit_camera(points, camera.width, camera.height, std::nullopt);
    ASSERT_TRUE(fitted.has_value()) << at.transpose();
    expect_same(*fitted, pose, points);
  }
}

TEST(OrganisedClouds, OfAPlaneNeedTheirViewpointInAnotherFrame) {
  const Eigen::Isometry3d pose = turned(Vec3(3.0, -2.0, 1.5));
  const auto points = seen_from(pose, false);
  const auto fitted = fit_camera(points, camera.width, camera.height, Vec3(3.0, -2.0, 1.5));
  ASSERT_TRUE(fitted.has_value());
  expect_same(*fitted, pose, points);
}

TEST(OrganisedClouds, ThatNoPinholeCameraSawStayPoints) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> anywhere(0.5, 1.5);
  std::vector<Vec3> noise(4800), mirrored = seen_from(turned(Vec3(1.0, 2.0, 3.0))), rings(4800);
  for (Vec3& p : noise) p = Vec3(anywhere(random), anywhere(random), anywhere(random));
  for (Vec3& p : mirrored) p.x() = -p.x();
  for (std::size_t i = 0; i < rings.size(); ++i) {  // of a lidar that turns
    const double azimuth = 6.28 * static_cast<double>(i % 80) / 80.0;
    const double elevation = 0.01 * static_cast<double>(i / 80);
    rings[i] = 5.0 * Vec3(std::cos(elevation) * std::cos(azimuth),
                          std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
  }
  const std::vector<Vec3> holes(4800, Vec3(nan, nan, nan)), one_place(4800, Vec3(0.0, 0.0, 1.0));
  const std::vector<Vec3> origin(4800, Vec3::Zero());
  for (const auto& points : {noise, mirrored, rings, holes, one_place, origin})
    EXPECT_FALSE(fit_camera(points, 80, 60, std::nullopt).has_value());
}

TEST(OrganisedClouds, WithManyPointsOutOfPlaceStayPoints) {
  auto points = seen_from(Eigen::Isometry3d::Identity());
  const auto fitted = fit_camera(points, 80, 60, std::nullopt);
  ASSERT_TRUE(fitted.has_value());
  points[40].x() += 0.1;  // 7 pixels
  const auto image = depth_image_of(points, *fitted);
  ASSERT_NE(image, nullptr) << "one of 4,114 is a hole";
  EXPECT_FALSE(image->deproject(40, 0).has_value());
  for (const std::size_t i : {50U, 61U, 72U, 82U, 96U, 110U}) points[i].x() += 0.1;
  EXPECT_EQ(depth_image_of(points, *fitted), nullptr);
  EXPECT_FALSE(fit_camera(points, 80, 60, std::nullopt).has_value());
}

TEST(OrganisedClouds, OfACameraThatMovesAreFittedOnce) {
  const Eigen::Isometry3d mount = turned(Vec3(0.1, 0.0, 0.2));
  const auto points = seen_from(mount);
  OrganisedClouds clouds;
  const auto first = clouds.image(points, 80, 60);
  ASSERT_NE(first, nullptr);
  const Eigen::Isometry3d moved = turned(Vec3(3.0, -2.0, 1.5));
  const auto second = clouds.image(points, 80, 60, std::nullopt, moved);
  ASSERT_NE(second, nullptr);
  EXPECT_EQ(second->shared_rays(), first->shared_rays());
  for (int u = 0; u < 80; u += 5) {
    const Vec3& given = points[static_cast<std::size_t>(30 * 80 + u)];
    const auto point = second->deproject(u, 30);
    ASSERT_EQ(point.has_value(), given.allFinite());
    if (!point) continue;
    EXPECT_LT((*point - moved * given).norm(), 0.6 / second->units_per_metre() + 1e-6);
  }
  EXPECT_EQ(clouds.image(points, 4800, 1), nullptr) << "one row is no image";
  const auto other = seen_from(turned(Vec3(0.0, 0.3, 0.0)));
  EXPECT_NE(clouds.image(other, 80, 60), nullptr) << "fitted anew";
}

}  // namespace test_organised
}  // namespace palpate
