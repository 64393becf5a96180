// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/pixel_probe.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_pixel_probe {

using test::fails_saying;

constexpr int width = 64;
constexpr int height = 48;

const Intrinsics camera{
    .width = width, .height = height, .fx = 60.0, .fy = 60.0, .cx = 31.5, .cy = 23.5};

// The plane z = 0.6 + slope x in the camera's frame, in units of 0.1 mm.
DepthImage plane(double slope, const Eigen::Isometry3d& pose, double step = 0.0) {
  const auto rays = std::make_shared<const ViewingRays>(camera);
  std::vector<std::uint16_t> depth(static_cast<std::size_t>(width) * height);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const double z = 0.6 / (1.0 - slope * rays->ray(u, v).x()) + (u >= 32 ? step : 0.0);
      depth[static_cast<std::size_t>(v * width + u)] =
          static_cast<std::uint16_t>(std::lround(1e4 * z));
    }
  }
  depth[0] = 0;
  depth[1] = 65535;
  return {rays, depth, 1e4, pose};
}

TEST(PixelProbe, SaysWhereAPixelsPointIsAndWhichWayItFaces) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(Vec3(1.0, 2.0, 3.0));
  pose.rotate(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  for (const double slope : {0.0, 0.4, -0.9}) {
    const DepthImage image = plane(slope, pose);
    const PixelProbe probe = probe_pixel(image, 20, 30);
    const Eigen::Vector2d ray = image.rays().ray(20, 30);
    const double z = 0.6 / (1.0 - slope * ray.x());
    EXPECT_NEAR(*probe.depth, z, 6e-5);
    EXPECT_TRUE(probe.in_camera->isApprox(*probe.depth * Vec3(ray.x(), ray.y(), 1.0), 1e-9));
    EXPECT_TRUE(probe.in_world->isApprox(pose * *probe.in_camera, 1e-9));
    ASSERT_TRUE(probe.normal) << slope;
    const Vec3 normal = pose.linear() * Vec3(slope, 0.0, -1.0).normalized();
    EXPECT_GT(probe.normal->dot(normal), 0.999) << "towards the camera, " << slope;
    EXPECT_EQ(probe.neighbours, 48);
    EXPECT_EQ(probe.measured, 48);
  }
}

TEST(PixelProbe, CountsNeighboursAndSaysNothingOfAHole) {
  const DepthImage image = plane(0.0, Eigen::Isometry3d::Identity());
  const PixelProbe hole = probe_pixel(image, 0, 0);
  EXPECT_FALSE(hole.in_world);
  EXPECT_FALSE(hole.depth);
  EXPECT_FALSE(hole.normal);
  EXPECT_EQ(hole.neighbours, 15);
  EXPECT_EQ(hole.measured, 14) << "65535 is a hole, too";
  EXPECT_TRUE(fails_saying([&] { return probe_pixel(image, 64, 0); }, "pixel 64,0", "64x48",
                           "0 to 63", "0 to 47"));
  EXPECT_TRUE(fails_saying([&] { return probe_pixel(image, 3, -1); }, "pixel 3,-1"));
}

TEST(PixelProbe, KeepsToOneSideOfAnEdgeAndGivesNoNormalWithoutASurface) {
  const DepthImage step = plane(0.0, Eigen::Isometry3d::Identity(), 0.1);
  EXPECT_GT(-probe_pixel(step, 31, 20).normal->z(), 0.999) << "the step behind it does not count";
  const auto rays = std::make_shared<const ViewingRays>(camera);
  std::vector<std::uint16_t> lonely(static_cast<std::size_t>(width) * height, 0);
  lonely[20 * width + 20] = 6000;
  const PixelProbe probe = probe_pixel(DepthImage(rays, lonely, 1e4), 20, 20);
  EXPECT_TRUE(probe.in_world);
  EXPECT_FALSE(probe.normal);
  EXPECT_EQ(probe.normal_radius, 0);
  EXPECT_EQ(probe.measured, 0);
}

TEST(PixelProbe, TakesAnOrganisedCloud) {
  Surface surface;
  surface.columns = 10;
  surface.rows = 8;
  for (int v = 0; v < 8; ++v) {
    for (int u = 0; u < 10; ++u) surface.points.emplace_back(0.002 * u, 0.002 * v, 1.0);
  }
  surface.points[3] = Vec3::Constant(std::nan(""));
  const PointCloud cloud(surface);
  const PixelProbe probe = probe_pixel(cloud, 4, 2);
  EXPECT_EQ(*probe.in_world, Vec3(0.008, 0.004, 1.0));
  EXPECT_FALSE(probe.depth) << "a cloud has no optical axis";
  EXPECT_TRUE(probe.normal->isApprox(-Vec3::UnitZ(), 1e-9));
  EXPECT_EQ(probe.neighbours, 7 * 6 - 1);
  EXPECT_EQ(probe.measured, 7 * 6 - 2);
  EXPECT_FALSE(probe_pixel(cloud, 3, 0).in_world);
  EXPECT_TRUE(fails_saying([&] { return probe_pixel(cloud, 10, 0); }, "10x8"));
  const PointCloud points(std::vector<Vec3>{Vec3::Zero()});
  EXPECT_TRUE(fails_saying([&] { return probe_pixel(points, 0, 0); }, "no pixels"));
}

}  // namespace test_pixel_probe
}  // namespace palpate
