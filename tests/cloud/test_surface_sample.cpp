// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"

namespace palpate {
namespace test_surface_sample {

constexpr double pitch = 1e-3;  // [m] between pixels of the wall

// A wall at z = 0.5 m before a camera at the origin, with labels 1 where u < 40 and 2 beyond, and
// brightness that grows by 2 of 255 with each column.
std::shared_ptr<DepthImage> wall(bool tilted = false) {
  constexpr int width = 81;
  constexpr int height = 61;
  const auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = width, .height = height, .fx = 500, .fy = 500, .cx = 40, .cy = 30});
  std::vector<std::uint16_t> depth;
  std::vector<std::uint8_t> labels;
  std::vector<std::uint8_t> brightness;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      depth.push_back(static_cast<std::uint16_t>(tilted ? 5000 + 10 * (u - 40) : 5000));
      labels.push_back(u < 40 ? 1 : 2);
      brightness.push_back(static_cast<std::uint8_t>(40 + 2 * u));
    }
  }
  auto image = std::make_shared<DepthImage>(rays, std::move(depth), 10000.0);
  MaterialTable table{.materials = {{.name = "a", .material = {}}, {.name = "b", .material = {}}}};
  table.materials[0].material.friction = 0.2;
  table.materials[1].material.friction = 0.8;
  image->set_materials(std::make_shared<LabelImage>(std::make_shared<const MaterialTable>(table),
                                                    std::move(labels), std::move(brightness)));
  return image;
}

double friction_at(const Cloud& cloud, const Vec3& place, double radius) {
  SurfaceSample sample;
  cloud.sample(place, -Vec3::UnitZ(), radius, sample);
  Material scene;
  scene.friction = -1.0;
  return blend(sample, scene, 600.0).friction;
}

TEST(SurfaceSample, IsTheMeanOfWhatLiesAbout) {
  const auto image = wall();
  EXPECT_TRUE(image->has_materials());
  EXPECT_TRUE(image->has_brightness());
  EXPECT_NEAR(friction_at(*image, Vec3(-0.01, 0, 0.5), 3e-3), 0.2, 1e-12);
  EXPECT_NEAR(friction_at(*image, Vec3(0.01, 0, 0.5), 3e-3), 0.8, 1e-12);
  // Without a step from one to the other.
  double before = 0.2;
  for (double x = -6e-3; x < 6e-3; x += 1e-4) {
    const double here = friction_at(*image, Vec3(x, 0.3e-3, 0.5), 3e-3);
    EXPECT_GE(here, before - 1e-3) << x;
    EXPECT_LE(here, before + 0.04) << x;
    before = here;
  }
  EXPECT_NEAR(before, 0.8, 1e-12);
}

TEST(SurfaceSample, HasTheSceneWhereNothingIsSeen) {
  const auto image = wall();
  EXPECT_EQ(friction_at(*image, Vec3(0.2, 0, 0.5), 3e-3), -1.0) << "beside the image";
  EXPECT_EQ(friction_at(*image, Vec3(0, 0, 0.4), 3e-3), -1.0) << "before the wall";
  EXPECT_EQ(friction_at(*image, Vec3(0, 0, -0.4), 3e-3), -1.0) << "behind the camera";
  EXPECT_EQ(friction_at(*image, Vec3(std::nan(""), 0, 0.5), 3e-3), -1.0);
}

TEST(SurfaceSample, HoldsAFewPixelsHoweverCoarseTheyAre) {
  // Pixels 1 mm apart, and less than that asked for.
  EXPECT_NEAR(friction_at(*wall(), Vec3(-0.0105, 0.0005, 0.5), 1e-4), 0.2, 1e-12);
}

TEST(SurfaceSample, FindsHowBrightnessGrows) {
  for (const bool tilted : {false, true}) {
    const auto image = wall(tilted);
    const Vec3 place = *image->deproject(40, 30);
    const Vec3 along = *image->deproject(50, 30) - *image->deproject(30, 30);
    const Vec3 normal = along.cross(Vec3::UnitY()).normalized();
    SurfaceSample sample;
    image->sample(place, normal, 3e-3, sample);
    ASSERT_TRUE(sample.has_slope);
    const double grows = 20 * 2 / 255.0 / along.norm();
    EXPECT_NEAR(sample.slope.dot(along.normalized()), grows, 0.03 * grows) << tilted;
    EXPECT_NEAR(sample.slope.y(), 0.0, 0.03 * grows);
    EXPECT_NEAR(sample.slope.dot(normal), 0.0, 1e-9);
  }
}

TEST(SurfaceSample, OfSeveralCamerasIsThatOfAll) {
  const auto bare = std::make_shared<PointCloud>(std::vector<Vec3>{Vec3(0, 0, 0.5)});
  const CloudSet set({bare, wall(), wall()});
  EXPECT_TRUE(set.has_materials());
  EXPECT_FALSE(bare->has_materials());
  EXPECT_NEAR(friction_at(set, Vec3(-0.01, 0, 0.5), 3e-3), 0.2, 1e-12);
  // Tables of their own, so two materials: equal ones.
  SurfaceSample sample;
  set.sample(Vec3(-0.01, 0, 0.5), -Vec3::UnitZ(), 3 * pitch, sample);
  EXPECT_EQ(sample.count, 2U);
}

}  // namespace test_surface_sample
}  // namespace palpate
