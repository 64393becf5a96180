// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_synthetic_camera {

using test::fails_saying;

std::unique_ptr<SyntheticCamera> camera(const std::string& text) {
  return open_synthetic_camera(Uri("synthetic:" + text));
}

const DepthImage& image(const Frame& frame) {
  return dynamic_cast<const DepthImage&>(*frame.cloud);
}

TEST(SyntheticCamera, LooksAtTheOriginFromWhereItIsPut) {
  const Eigen::Isometry3d above = looking_at_origin(0.7, 0.0, 0.0);
  EXPECT_TRUE((above * Vec3(0.0, 0.0, 0.7)).isZero(1e-12));
  EXPECT_TRUE((above.linear() * Vec3::UnitX()).isApprox(Vec3::UnitX()));
  EXPECT_TRUE((above.linear() * Vec3::UnitY()).isApprox(-Vec3::UnitY()));
  const Eigen::Isometry3d tilted = looking_at_origin(0.7, 0.5, 0.0);
  EXPECT_TRUE(tilted.translation().isApprox(0.7 * Vec3(0.0, -std::sin(0.5), std::cos(0.5))));
  EXPECT_TRUE((tilted * Vec3(0.0, 0.0, 0.7)).isZero(1e-12));
  const Eigen::Isometry3d beside = looking_at_origin(0.7, 0.5, std::numbers::pi / 2.0);
  EXPECT_TRUE(beside.translation().isApprox(0.7 * Vec3(std::sin(0.5), 0.0, std::cos(0.5))));
  EXPECT_NEAR(beside.linear().determinant(), 1.0, 1e-12);
}

TEST(SyntheticCamera, EveryPointItMeasuresWithoutNoiseLiesOnTheSurface) {
  for (const SceneInfo& info : known_scenes()) {
    const auto source = camera(std::string(info.name) +
                               "?size=120x90&speed=0.02&stroke=10mm&swing=3deg&azimuth=20deg");
    static_cast<void>(source->next());
    for (int k = 1; k < 4; ++k) {
      const Frame frame = *source->next();
      const Vec3 eye = source->setup().world_from_camera.translation();
      int measured = 0;
      for (int v = 0; v < 90; ++v) {
        for (int u = 0; u < 120; ++u) {
          const auto point = image(frame).deproject(u, v);
          if (!point) continue;
          ++measured;
          // Half a unit of depth along a ray that is longer towards the image's border.
          const Eigen::Vector2d ray = image(frame).rays().ray(u, v);
          const double along = 0.5e-4 * Vec3(ray.x(), ray.y(), 1.0).norm() + 1e-6;
          const Vec3 direction = (*point - eye).normalized();
          EXPECT_GE(source->scene().signed_distance(*point - along * direction, frame.stamp), -1e-9)
              << info.name << ' ' << u << ' ' << v;
          EXPECT_LE(std::abs(source->scene().signed_distance(*point, frame.stamp)), along)
              << info.name << ' ' << u << ' ' << v;
        }
      }
      EXPECT_GT(measured, 25) << info.name;
    }
  }
}

TEST(SyntheticCamera, DrawsWhatSingleRaysFind) {
  for (const SceneInfo& info : known_scenes()) {
    const auto source =
        camera(std::string(info.name) + "?size=80x60&stroke=20mm&swing=10deg&start=0.1s");
    const Eigen::Isometry3d& pose = source->setup().world_from_camera;
    const ViewingRays rays(source->setup().intrinsics);
    for (const double t : {0.0, 0.3, 0.45}) {
      const std::span<const float> depth = source->true_depth(t);
      for (int v = 0; v < 60; ++v) {
        for (int u = 0; u < 80; ++u) {
          const Eigen::Vector2d ray = rays.ray(u, v);
          const auto s = source->scene().cast(pose.translation(),
                                              pose.linear() * Vec3(ray.x(), ray.y(), 1.0), t);
          const float drawn = depth[v * 80 + u];
          ASSERT_EQ(std::isfinite(drawn), s.has_value()) << info.name << ' ' << u << ' ' << v;
          if (!s) continue;
          EXPECT_NEAR(drawn, *s, 1e-6 * *s) << info.name << ' ' << u << ' ' << v;
        }
      }
    }
  }
}

TEST(SyntheticCamera, StampsFramesByItsRateAndEndsWhenTold) {
  const auto source = camera("plane?size=8x6&fps=25Hz&frames=3");
  EXPECT_EQ(source->info().frames, 3U);
  EXPECT_EQ(source->info().frame_rate, 25.0);
  EXPECT_EQ(source->info().uri, "synthetic:plane?size=8x6&fps=25Hz&frames=3");
  for (int k = 0; k < 3; ++k) EXPECT_EQ(source->next()->stamp, k / 25.0);
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(camera("plane?size=8x6")->info().frames);
}

TEST(SyntheticCamera, SeesThePaintedWavesWhereItsPointsAre) {
  const auto source = camera("wedge?size=60x40&brightness=50mm");
  const Frame frame = *source->next();
  const DepthImage& seen = image(frame);
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 60; ++u) {
      const auto point = seen.deproject(u, v);
      if (!point) continue;
      const double wave = 0.5 + 0.5 * std::sin(2.0 * std::numbers::pi * point->x() / 0.05);
      // A depth is rounded to 0.1 mm.
      EXPECT_NEAR(seen.brightness()[static_cast<std::size_t>(60 * v + u)], 255.0 * wave, 1.5);
    }
  }
  EXPECT_TRUE(image(*camera("wedge?size=60x40")->next()).brightness().empty());
}

TEST(SyntheticCamera, SeesColouredWavesAlongEachAxisOnRequest) {
  const Frame frame = *camera("wedge?size=60x40&colour=50mm")->next();
  ASSERT_NE(frame.colour, nullptr);
  EXPECT_FALSE(frame.colour->camera);
  ASSERT_EQ(frame.colour->rgb.size(), 3U * 60U * 40U);
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 60; ++u) {
      const auto point = image(frame).deproject(u, v);
      if (!point) continue;
      for (int axis = 0; axis < 3; ++axis) {
        const double wave = 0.5 + 0.5 * std::sin(2.0 * std::numbers::pi * (*point)[axis] / 0.05);
        EXPECT_NEAR(frame.colour->rgb[static_cast<std::size_t>(3 * (60 * v + u) + axis)],
                    255.0 * wave, 1.5);
      }
    }
  }
  EXPECT_EQ(camera("wedge?size=60x40")->next()->colour, nullptr);
}

TEST(SyntheticCamera, SeesALiftedPlaneComeNearer) {
  const auto source = camera("plane?size=9x9&tilt=0deg&distance=0.7m&speed=0.3&fps=10");
  for (int k = 0; k < 10; ++k) {
    const Frame frame = *source->next();
    EXPECT_EQ(image(frame).depth()[4 * 9 + 4], 7000 - 300 * k);
  }
}

TEST(SyntheticCamera, TheSameFrameHasTheSameBitsInWhateverOrderItIsTaken) {
  const std::string text = "moving?size=64x48&noise=2mm&correlation=4&dropouts=2%&flying=30%";
  const auto in_order = camera(text);
  std::vector<Frame> frames;
  for (int k = 0; k < 5; ++k) frames.push_back(*in_order->next());
  const auto jumping = camera(text);
  for (const int k : {4, 0, 3, 3, 1}) {
    EXPECT_EQ(image(jumping->capture(k / 30.0, k)).depth(), image(frames[k]).depth()) << k;
  }
  EXPECT_NE(image(camera(text + "&seed=2")->capture(0.0, 0)).depth(), image(frames[0]).depth());
}

TEST(SyntheticCamera, TheDeskFillsTheImageAndIsTheDefault) {
  const auto desk = camera("");
  EXPECT_EQ(desk->info().kind, "synthetic depth camera, scene desk");
  const Frame frame = *desk->next();
  EXPECT_EQ(image(frame).intrinsics().width, 640);
  std::size_t near = 0;
  for (const Vec3& point : image(frame).points()) near += point.z() > -0.001 ? 1 : 0;
  EXPECT_GT(near, 640U * 480U * 9 / 10);
  EXPECT_EQ(image(*camera("?noise=0mm&size=80x60")->next()).intrinsics().width, 80);
}

TEST(SyntheticCamera, IsASourceLikeAnyOther) {
  const auto source = open_source("synthetic:sphere?radius=60mm&size=32x24&sensor=d4xx");
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  EXPECT_DOUBLE_EQ(image(*frame).units_per_metre(), 1000.0);
}

TEST(SyntheticCamera, OptionsThatCannotBeAreNamed) {
  EXPECT_TRUE(fails_saying([] { return camera("desk?nose=1mm"); }, "'nose'", "'noise'"));
  EXPECT_TRUE(fails_saying([] { return camera("sphere?radus=1mm"); }, "did you mean 'radius'"));
  EXPECT_TRUE(fails_saying([] { return camera("plane?radius=1mm"); }, "unknown option 'radius'"));
  EXPECT_TRUE(fails_saying([] { return camera("dsk"); }, "did you mean 'desk'"));
  EXPECT_TRUE(fails_saying([] { return camera("desk?sensor=lidar"); }, "lidar", "d4xx"));
  for (const char* size :
       {"", "640", "640x", "0x480", "-1x4", "1e9x1e9", "nanx2", "6.5x4", "4x4x4"}) {
    EXPECT_TRUE(fails_saying([&] { return camera("desk?size=" + std::string(size)); }, "'size'"))
        << size;
  }
  EXPECT_TRUE(fails_saying([] { return camera("desk?correlation=5y"); }, "'correlation'"));
  EXPECT_TRUE(fails_saying([] { return camera("desk?frames=1.5"); }, "'frames'", "whole"));
  EXPECT_TRUE(fails_saying([] { return camera("desk?frames=0"); }, "'frames'"));
  EXPECT_TRUE(fails_saying([] { return camera("desk?seed=-1"); }, "'seed'"));
  EXPECT_TRUE(fails_saying([] { return camera("desk?fps=0"); }, "'fps'"));
  EXPECT_TRUE(fails_saying([] { return camera("desk?noise=1deg"); }, "'noise'"));
  EXPECT_TRUE(fails_saying([] { return camera("desk?quantisation=0"); }, "'quantisation'"));
  EXPECT_TRUE(fails_saying([] { return camera("desk?fov=180deg"); }, "'fov'"));
}

}  // namespace test_synthetic_camera
}  // namespace palpate
