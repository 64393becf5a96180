// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/scene.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_scene {

using test::fails_saying;

constexpr double pi = std::numbers::pi;

Scene scene(const std::string& text) { return make_scene(Uri("synthetic:" + text)); }

// Height of the scene over (x, y), seen from straight above.
double height(const Scene& scene, double x, double y, double t = 0.0) {
  const auto s = scene.cast(Vec3(x, y, 2.0), -Vec3::UnitZ(), t);
  return s ? 2.0 - *s : -1e9;
}

TEST(Scene, SurfacesLieWhereTheirNamesSay) {
  EXPECT_NEAR(height(scene("plane"), 0.1, -0.2), 0.0, 1e-12);
  EXPECT_NEAR(height(scene("tilt?slope=30deg"), 0.1, 0.3), 0.1 * std::tan(pi / 6.0), 1e-12);
  EXPECT_NEAR(height(scene("sphere?radius=40mm"), 0.01, 0.02), -0.04 + std::sqrt(0.0016 - 0.0005),
              1e-12);
  EXPECT_NEAR(height(scene("cylinder?radius=20mm"), 0.01, 0.05), -0.02 + std::sqrt(0.0004 - 0.0001),
              1e-12);
  EXPECT_NEAR(height(scene("wedge"), 0.01, 0.5), -0.01, 1e-12);
  EXPECT_NEAR(height(scene("wedge?edge=concave&angle=120deg"), -0.01, 0.5),
              0.01 / std::tan(pi / 3.0), 1e-12);
  EXPECT_NEAR(height(scene("relief?height=3mm&length=10mm"), 0.0025, 0.0), 0.0015, 1e-12);
  EXPECT_NEAR(height(scene("box?edge=80mm"), 0.039, -0.039), 0.0, 1e-12);
  EXPECT_LT(height(scene("box?edge=80mm"), 0.041, 0.0), -1.0);
  EXPECT_NEAR(height(scene("layers?separation=20mm"), 0.01, 0.0), -0.02, 1e-12);
  EXPECT_NEAR(height(scene("layers"), -0.01, 0.0), 0.0, 1e-12);
  EXPECT_LT(height(scene("hole?width=20mm"), 0.009, -0.009), -1.0);
  EXPECT_NEAR(height(scene("hole?width=20mm"), 0.011, 0.0), 0.0, 1e-12);
  EXPECT_NEAR(height(scene("sphere?floor=100mm"), 0.2, 0.0), -0.1, 1e-12);
  // The ramp of the desk rises by 80 mm over 200 mm; the box is 70 mm high.
  EXPECT_NEAR(height(scene("desk"), -0.14, 0.08), 0.04, 1e-12);
  EXPECT_NEAR(height(scene("desk"), 0.08, 0.08), 0.07, 1e-12);
  EXPECT_NEAR(height(scene("desk"), -0.02, 0.0), 0.0, 1e-12);
}

TEST(Scene, TheTriangleWaveGrowsAlongX) {
  const Scene wave = scene("triangle-wave?period=30mm&extent=450mm&height=30mm");
  for (int corner = 1; corner < 30; ++corner) {
    const double x = -0.225 + 0.015 * corner;
    const double amplitude = 0.015 * corner / 30.0;
    const double sign = corner % 2 == 0 ? -1.0 : 1.0;
    EXPECT_NEAR(height(wave, x, 0.0), sign * amplitude, 1e-9) << corner;
  }
}

TEST(Scene, ABallRestsInTheGapWhereGeometrySays) {
  // A ball of 5 mm on two edges 6 mm apart: its centre is 4 mm above them.
  const SurfacePoint near = scene("gap?width=6mm").nearest(Vec3(0.0, 0.0, 0.004), 0.0);
  EXPECT_NEAR(near.distance, 0.005, 1e-12);
  EXPECT_NEAR(std::abs(near.point.x()), 0.003, 1e-12);
}

TEST(Scene, ALiftFollowsItsLaw) {
  const Scene lift = scene("plane?start=0.5s&speed=0.1&acceleration=3");
  EXPECT_EQ(height(lift, 0.0, 0.0, 0.5), 0.0);
  EXPECT_NEAR(height(lift, 0.0, 0.0, 0.8), 0.1 * 0.3 + 1.5 * 0.09, 1e-12);
  EXPECT_NEAR(lift.nearest(Vec3(0.1, 0.0, 0.3), 0.8).velocity.z(), 0.1 + 3.0 * 0.3, 1e-12);
  EXPECT_EQ(lift.nearest(Vec3(0.1, 0.0, 0.3), 0.4).velocity, Vec3::Zero());
}

TEST(Scene, TheMovingDeskBobsTwentyMillimetresOnceASecond) {
  const Scene desk = scene("moving");
  const double rest = height(desk, 0.0, -0.08, 0.0);
  EXPECT_NEAR(height(desk, 0.0, -0.08, 0.25), rest + 0.010, 1e-12);
  EXPECT_NEAR(height(desk, 0.0, -0.08, 0.5), rest + 0.020, 1e-12);
  EXPECT_NEAR(height(desk, 0.0, -0.08, 1.0), rest, 1e-12);
  EXPECT_NEAR(desk.nearest(Vec3(0.0, -0.08, rest + 0.015), 0.25).velocity.z(), pi * 0.020, 1e-12);
}

TEST(Scene, VelocityIsHowFastItsMaterialMoves) {
  Motion motion;
  motion.direction = Vec3(0.6, 0.0, 0.8);
  motion.start = 0.1;
  motion.speed = 0.2;
  motion.acceleration = -0.7;
  motion.stroke = 0.05;
  motion.frequency = 2.5;
  motion.swing = 0.4;
  motion.axis = Vec3(1.0, 2.0, -1.0).normalized();
  motion.pivot = Vec3(0.1, -0.2, 0.05);
  const Vec3 began(0.3, 0.2, -0.1);
  for (const double t : {0.15, 0.31, 0.77, 1.2}) {
    constexpr double h = 1e-6;
    const Vec3 measured = (motion.at(t + h) * began - motion.at(t - h) * began) / (2.0 * h);
    EXPECT_LT((motion.velocity(motion.at(t) * began, t) - measured).norm(), 1e-7) << t;
  }
  EXPECT_TRUE(motion.at(0.1).isApprox(Eigen::Isometry3d::Identity()));
}

TEST(Scene, EveryRayEndsOnTheSurfaceOfEveryScene) {
  std::mt19937_64 engine(7);
  std::uniform_real_distribution<double> draw(-0.25, 0.25);
  for (const SceneInfo& info : known_scenes()) {
    const Scene named =
        scene(std::string(info.name) + "?speed=0.03&stroke=12mm&frequency=1.5hz&swing=5deg");
    int hits = 0;
    for (int i = 0; i < 200; ++i) {
      const double t = 0.01 * i;
      const Vec3 from(draw(engine), draw(engine), 0.8);
      const Vec3 towards = Vec3(0.3 * draw(engine), 0.3 * draw(engine), 0.0) - from;
      const auto s = named.cast(from, towards, t);
      if (!s) continue;
      ++hits;
      const SurfacePoint near = named.nearest(from + *s * towards, t);
      EXPECT_NEAR(near.distance, 0.0, 1e-9) << info.name << " ray " << i;
      EXPECT_LT(near.normal.dot(towards), 1e-6) << info.name << " ray " << i;
      EXPECT_GT(named.signed_distance(from + (*s - 1e-4) * towards, t), 0.0) << info.name;
    }
    EXPECT_GT(hits, 5) << info.name;
  }
}

TEST(Scene, DepthIsNotOverstatedWherePartsOverlap) {
  const Scene desk = scene("desk");
  // 10 mm under the top of the box, and 5 mm under the table beside it.
  EXPECT_NEAR(desk.signed_distance(Vec3(0.08, 0.08, 0.06), 0.0), -0.010, 1e-12);
  EXPECT_NEAR(desk.signed_distance(Vec3(-0.02, 0.0, -0.005), 0.0), -0.005, 1e-12);
  // Where the box meets the table no seam looks like a surface.
  EXPECT_LT(desk.signed_distance(Vec3(0.08, 0.08, 0.0), 0.0), -0.019);
}

TEST(Scene, UnknownNamesAndImpossibleValuesAreRefused) {
  EXPECT_TRUE(fails_saying([] { return scene("plain"); }, "did you mean 'plane'?", "desk"));
  EXPECT_TRUE(fails_saying([] { return scene("wedge?edge=round"); }, "'edge'", "concave"));
  EXPECT_TRUE(fails_saying([] { return scene("sphere?radius=0"); }, "'radius'", "out of range"));
  EXPECT_TRUE(fails_saying([] { return scene("sphere?radius=40deg"); }, "'radius'", "mm"));
  EXPECT_TRUE(fails_saying([] { return scene("triangle-wave?period=1m"); }, "'period'", "corners"));
  EXPECT_TRUE(fails_saying([] { return scene_options("plain"); }, "plane"));
  EXPECT_THROW(Scene({}), Error);
}

}  // namespace test_scene
}  // namespace palpate
