// SPDX-License-Identifier: Apache-2.0
// No length and no time is built into sight: a session in which all lengths, or all times, are
// another multiple is the same session. docs/sight.md, 11.
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/sight/sight.hpp"

#include "tests/support/scale.hpp"

namespace palpate {
namespace {

using test::Scale;

// [m] above the plane z = 0, at a place and time of the unscaled session.
using Relief = std::function<double(double x, double y, double t)>;
using HipPath = std::function<Vec3(double t)>;
struct Scene {
  const char* name;
  Relief relief;
  HipPath hip;
  double until;         // [s]
  double noise = 1e-3;  // [m]
};

std::vector<Tick> play(const Scene& scene, const Scale& scale) {
  constexpr double distance = 0.6, interval = 1.0 / 32.0, units = 1e4;
  constexpr int ticks = 32;
  const auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = 160, .height = 120, .fx = 280, .fy = 280, .cx = 79.5, .cy = 59.5});
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Vec3(1, -1, -1).asDiagonal();
  pose.translation() = Vec3(0, 0, scale.length * distance);
  Sight sight(test::scaled({}, scale));
  sight.seat(scale.length * scene.hip(0.0));
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, scene.noise);
  std::vector<Tick> felt;
  std::unique_ptr<DepthImage> image;
  for (int frame = 0; frame * interval < scene.until; ++frame) {
    const double stamp = frame * interval;
    std::vector<std::uint16_t> depth;
    for (int v = 0; v < 120; ++v) {
      for (int u = 0; u < 160; ++u) {
        const Eigen::Vector2d ray = rays->ray(u, v);
        double z = distance;
        for (int i = 0; i < 3; ++i) z = distance - scene.relief(z * ray.x(), -z * ray.y(), stamp);
        depth.push_back(static_cast<std::uint16_t>((z + noise(random)) * units + 0.5));
      }
    }
    image = std::make_unique<DepthImage>(rays, std::move(depth), units / scale.length, pose);
    sight.observe({*image, scale.time * stamp});
    for (int i = 0; i < ticks; ++i) {
      const double t = stamp + interval * i / ticks;
      felt.push_back(sight.tick(scale.length * scene.hip(t), scale.time * t));
    }
  }
  return felt;
}

double between(double x, double from, double to) { return std::min(std::max(x, from), to); }

std::vector<Scene> scenes() {
  const auto presses = [](double x, double depth) {
    return [=](double t) { return Vec3(x, 0.0, std::max(0.05 - 0.15 * t, -depth)); };
  };
  return {
      {"a plane that begins to rise under the hand",
       [](double, double, double t) { return 0.04 * between(t - 1.0, 0.0, 0.4); },
       presses(0.0, 0.008), 1.8},
      {"a stroke over a bowl and its rim",
       [](double x, double y, double) {
         return std::min(12.0 * (x * x + y * y), 0.02) + 0.03 * std::sin(9.0 * x);
       },
       [](double t) { return Vec3(0.08 * t - 0.05, 0.01, std::max(0.05 - 0.15 * t, -0.004)); },
       1.8},
      {"a concave corner", [](double x, double, double) { return std::max(1.2 * x, 0.0); },
       presses(0.0, 0.006), 1.4},
      {"an arm that passes between the camera and the hand",
       [](double x, double y, double t) {
         return std::abs(x - 0.5 * (t - 1.0)) < 0.05 && y < 0.08 ? 0.15 : 0.0;
       },
       presses(0.0, 0.008), 2.2},
      {"a box that slides in under the hand",
       [](double x, double, double t) { return x < 0.25 * (t - 1.0) - 0.05 ? 0.02 : 0.0; },
       presses(0.0, 0.006), 1.8},
      {"an exact image of a step", [](double x, double, double) { return x > 0.01 ? 0.03 : 0.0; },
       [](double t) { return Vec3(0.06 * t - 0.05, 0.0, std::max(0.05 - 0.15 * t, -0.005)); }, 1.4,
       0.0},
  };
}

void expect_same(const std::vector<Tick>& one, const std::vector<Tick>& other, const Scale& scale,
                 const char* scene) {
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    ASSERT_EQ(scale.length * one[i].proxy, other[i].proxy) << scene << ", tick " << i;
    ASSERT_EQ(scale.length * one[i].force, other[i].force) << scene << ", tick " << i;
    ASSERT_EQ(one[i].normal, other[i].normal) << scene << ", tick " << i;
    ASSERT_EQ(one[i].flags, other[i].flags) << scene << ", tick " << i;
  }
}

TEST(Scale, ForcesAreTheSameWhateverTheLengthsAndTimesAreMultiplesOf) {
  for (const Scene& scene : scenes()) {
    const std::vector<Tick> usual = play(scene, {});
    double most = 0.0;
    for (const Tick& tick : usual) most = std::max(most, tick.force.norm());
    EXPECT_GT(most, 1.0) << scene.name;
    for (const Scale scale : {Scale{0.25, 1.0}, Scale{4.0, 1.0}, Scale{1.0, 0.5}, Scale{1.0, 8.0}})
      expect_same(usual, play(scene, scale), scale, scene.name);
  }
}

}  // namespace
}  // namespace palpate
