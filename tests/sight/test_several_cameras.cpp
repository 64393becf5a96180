// SPDX-License-Identifier: Apache-2.0
// Two RealSense D4xx, 40 degrees apart, above a plane at rest, a hand 8 mm in it. Numbers are
// pooled over ten seeds.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/sight/sight.hpp"

namespace palpate {
namespace test_several_cameras {

constexpr double degrees = std::numbers::pi / 180.0;
constexpr double interval = 1.0 / 30.0;
constexpr double down = 0.5;      // [s] the hand begins to press
constexpr double settled = 2.5;   // [s] every camera's memory is full
constexpr double duration = 4.5;  // [s]
constexpr double depth = 8e-3;    // [m]
constexpr int seeds = 10;

// What is felt at rest.
struct Felt {
  double sum = 0.0, squares = 0.0, count = 0.0;  // of the force [N]
  double largest_step = 0.0;                     // [N] from tick to tick
  std::uint32_t flags = 0;
  double last = 0.0;  // [N]

  void add(const Tick& tick, bool at_rest) {
    const double force = tick.force.norm();
    if (at_rest) {
      sum += force;
      squares += force * force;
      ++count;
      largest_step = std::max(largest_step, std::abs(force - last));
      flags |= tick.flags;
    }
    last = force;
  }
  [[nodiscard]] double rms() const {
    return std::sqrt(std::max(squares / count - sum / count * (sum / count), 0.0));
  }
};

struct Rig {
  std::array<double, 2> distance = {0.7, 0.7};  // [m]
  double late = 0.5 * interval;                 // [s] of the second camera's frames
  double pose_error = 0.0;                      // [m] the second camera is taken to be higher
  double first_blind_from = 1e9;                // [s] it sees what is 0.2 m before the plane
};

SyntheticCamera camera_of(const Rig& rig, std::size_t number, std::uint64_t seed) {
  // Pixels as a D4xx has them, around the contact.
  CameraSetup setup;
  setup.intrinsics = pinhole(200, 200, 2.0 * std::atan(100.0 / 589.0));
  setup.world_from_camera =
      looking_at_origin(rig.distance[number], 20 * degrees, number == 0 ? 0.0 : 180 * degrees);
  SensorModel sensor = SensorModel::named("d4xx");
  sensor.seed = seed;
  return {make_scene(Uri("synthetic:plane")), setup, sensor};
}

std::shared_ptr<const Cloud> raised(const DepthImage& image, double height) {
  Eigen::Isometry3d pose = image.world_from_camera();
  pose.translation().z() += height;
  return std::make_shared<DepthImage>(image.shared_rays(), image.depth(), image.units_per_metre(),
                                      pose);
}

// The first camera alone, the second alone, both.
std::array<Felt, 3> feel(const Rig& rig) {
  std::array<Felt, 3> felt;
  Parameters parameters;
  parameters.sight.usual_noise = 5e-3;
  parameters.sight.noise_growth = 2;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    std::array<SyntheticCamera, 2> cameras = {camera_of(rig, 0, 2 * seed),
                                              camera_of(rig, 1, 2 * seed + 1)};
    std::array<std::unique_ptr<Sight>, 3> methods;
    for (auto& method : methods) {
      method = std::make_unique<Sight>(parameters);
      method->seat({0.0, 0.0, 0.02});
    }
    std::array<std::shared_ptr<const Cloud>, 2> in_use;
    std::array<std::uint64_t, 2> next{};
    for (int i = 0; i * 1e-3 < duration; ++i) {
      const double t = i * 1e-3;
      for (std::size_t c = 0; c < 2; ++c) {
        const double stamp = static_cast<double>(next[c]) * interval + (c == 1 ? rig.late : 0.0);
        if (stamp > t) continue;
        std::shared_ptr<const Cloud> cloud = cameras[c].capture(stamp, next[c]++).cloud;
        if (c == 1 && rig.pose_error != 0.0) cloud = raised(*cloud->image(), rig.pose_error);
        if (c == 0 && stamp >= rig.first_blind_from) cloud = raised(*cloud->image(), 0.2);
        methods[c]->observe({*cloud, stamp});
        methods[2]->observe({*cloud, stamp, c});
        in_use[c] = cloud;
      }
      const Vec3 hip(0.0, 0.0, std::clamp(0.02 - 0.05 * (t - down), -depth, 0.02));
      for (std::size_t m = 0; m < methods.size(); ++m)
        felt[m].add(methods[m]->tick(hip, t), t >= settled);
    }
  }
  return felt;
}

void print(const char* name, const std::array<Felt, 3>& felt) {
  std::printf(
      "%s: rms %.4f, %.4f, both %.4f N; steps %.4f, %.4f, both %.4f N; mean %.3f %.3f %.3f\n", name,
      felt[0].rms(), felt[1].rms(), felt[2].rms(), felt[0].largest_step, felt[1].largest_step,
      felt[2].largest_step, felt[0].sum / felt[0].count, felt[1].sum / felt[1].count,
      felt[2].sum / felt[2].count);
}

TEST(SeveralCameras, AreStillerThanTheBestOfThemAlone) {
  const auto felt = feel({});
  print("between each other's frames", felt);
  EXPECT_LE(felt[2].rms(), std::min(felt[0].rms(), felt[1].rms()));
  const auto at_once = feel({.late = 0.0});
  print("at once", at_once);
  EXPECT_LE(at_once[2].rms(), std::min(at_once[0].rms(), at_once[1].rms()));
}

TEST(SeveralCameras, AreStillerThanTheNearOneAloneWhereTheOtherIsFar) {
  const auto felt = feel({.distance = {0.7, 0.95}});
  print("near and far", felt);
  EXPECT_LE(felt[2].rms(), felt[0].rms());
}

TEST(SeveralCameras, WhosePosesDisagreeDoNotBuzz) {
  const auto felt = feel({.pose_error = 3e-3});
  print("3 mm apart", felt);
  EXPECT_LE(felt[2].rms(), 1.5 * std::max(felt[0].rms(), felt[1].rms()));
}

TEST(SeveralCameras, GoOnWhereOneOfThemIsBlinded) {
  const auto felt = feel({.first_blind_from = 3.0});
  print("one is blinded", felt);
  EXPECT_TRUE(felt[0].flags & surface_hidden);
  EXPECT_FALSE(felt[2].flags & surface_hidden);
  EXPECT_LE(felt[2].rms(), 1.5 * felt[1].rms());
}

}  // namespace test_several_cameras
}  // namespace palpate
