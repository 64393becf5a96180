// SPDX-License-Identifier: Apache-2.0
// What a servo loop has to be able to rely on, whatever a camera or a hand sends.
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/sight/sight.hpp"

#include "tests/support/allocations.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace test_sight_safety {

constexpr double interval = 1.0 / 30.0;
constexpr double max_force = 20.0;

// Passes on what a cloud says, and counts how often it is asked and how much it may answer.
class Counted final : public Cloud {
 public:
  explicit Counted(const Cloud& cloud) : cloud_(cloud) {}
  void gather(const Ball& ball, std::size_t most, Patch& patch) const noexcept override {
    ++gathers;
    cloud_.gather(ball, most, patch);
  }
  void gather(const Beam& beam, std::size_t most, Patch& patch) const noexcept override {
    ++gathers;
    beam_points += most;
    cloud_.gather(beam, most, patch);
  }
  [[nodiscard]] bool has_noise() const noexcept override { return cloud_.has_noise(); }
  [[nodiscard]] double noise_at(const Vec3& place, double usual) const noexcept override {
    return cloud_.noise_at(place, usual);
  }
  [[nodiscard]] const DepthImage* image() const noexcept override { return cloud_.image(); }
  mutable int gathers = 0;
  mutable std::size_t beam_points = 0;

 private:
  const Cloud& cloud_;
};

// Says that there are points which are no numbers, or too far for a float's square.
class Garbage final : public Cloud {
 public:
  explicit Garbage(float value) : value_(value) {}
  void gather(const Ball&, std::size_t, Patch& patch) const noexcept override { fill(patch); }
  void gather(const Beam&, std::size_t, Patch& patch) const noexcept override { fill(patch); }

 private:
  void fill(Patch& patch) const noexcept {
    patch.start_view(Vec3(0, 0, 1));
    for (int i = 0; i < 100; ++i) {
      const auto x = 1e-3F * static_cast<float>(i % 10 - 5);
      const auto y = 1e-3F * static_cast<float>(i / 10 - 5);
      patch.push(x, y, i % 3 == 0 ? value_ : 0.0F);
    }
  }
  float value_;
};

std::vector<std::unique_ptr<Cloud>> hostile_clouds() {
  std::vector<std::unique_ptr<Cloud>> clouds;
  const Vec3 eye(0, 0, 1);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> anywhere(-0.1, 0.1);
  std::vector<Vec3> dust;
  for (int i = 0; i < 5000; ++i) {
    dust.emplace_back(anywhere(random), anywhere(random), anywhere(random));
  }
  std::vector<Vec3> line;
  for (int i = -50; i <= 50; ++i) line.emplace_back(1e-3 * i, 0.0, 0.0);
  clouds.push_back(std::make_unique<PointCloud>(test::flat_grid(0.0, 1.5e-3, 40), eye));
  clouds.push_back(std::make_unique<PointCloud>(std::vector<Vec3>{}, eye));
  clouds.push_back(std::make_unique<PointCloud>(test::flat_grid(0.05, 1.5e-3, 40), eye));
  clouds.push_back(std::make_unique<PointCloud>(test::flat_grid(-0.2, 1.5e-3, 40), eye));
  clouds.push_back(std::make_unique<PointCloud>(test::flat_grid(0.0, 1.5e-3, 40)));
  clouds.push_back(std::make_unique<PointCloud>(dust, eye));
  clouds.push_back(std::make_unique<PointCloud>(line, eye));
  clouds.push_back(std::make_unique<PointCloud>(std::vector<Vec3>(500, Vec3(0, 0, 0)), eye));
  clouds.push_back(std::make_unique<PointCloud>(test::flat_grid(0.0, 1.5e-3, 40), Vec3(0, 0, 0)));
  const Intrinsics k{.width = 64, .height = 48, .fx = 60.0, .fy = 60.0, .cx = 31.5, .cy = 23.5};
  const auto rays = std::make_shared<ViewingRays>(k);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  pose.translation() = Vec3(0, 0, 0.3);
  std::uniform_int_distribution<int> any(0, 65535);
  std::vector<std::uint16_t> wild(64 * 48);
  for (std::uint16_t& depth : wild) depth = static_cast<std::uint16_t>(any(random));
  for (const std::uint16_t depth : {std::uint16_t{0}, std::uint16_t{1}, std::uint16_t{300},
                                    std::uint16_t{65534}, std::uint16_t{65535}}) {
    clouds.push_back(
        std::make_unique<DepthImage>(rays, std::vector<std::uint16_t>(64 * 48, depth), 1e3, pose));
  }
  clouds.push_back(std::make_unique<DepthImage>(rays, wild, 1e3, pose));
  clouds.push_back(std::make_unique<DepthImage>(rays, wild, 1e-3, pose));
  // Noise of any size, and none at all.
  std::vector<float> noise(wild.begin(), wild.end());
  for (const double units : {1e3, 1e-3}) {
    for (const float each : {0.0F, 1e-3F, 1.0F}) {
      for (float& value : noise) value *= each;
      auto plane =
          std::make_unique<DepthImage>(rays, std::vector<std::uint16_t>(64 * 48, 300), units, pose);
      plane->set_noise(noise);
      clouds.push_back(std::move(plane));
      noise.assign(wild.begin(), wild.end());
    }
  }
  return clouds;
}

Vec3 hostile_hip(std::mt19937& random) {
  constexpr std::array<double, 8> values = {0.0,
                                            -0.01,
                                            0.004,
                                            1e300,
                                            -1e7,
                                            std::numeric_limits<double>::quiet_NaN(),
                                            std::numeric_limits<double>::infinity(),
                                            1e-300};
  std::uniform_int_distribution<std::size_t> any(0, values.size() - 1);
  std::uniform_int_distribution<int> dice(0, 9);
  if (dice(random) != 0) {
    std::uniform_real_distribution<double> near(-0.03, 0.03);
    return {near(random), near(random), near(random)};
  }
  return {values[any(random)], values[any(random)], values[any(random)]};
}

void expect_sane(const Tick& tick) {
  ASSERT_TRUE(tick.force.allFinite());
  ASSERT_TRUE(tick.proxy.allFinite());
  ASSERT_TRUE(tick.normal.allFinite());
  ASSERT_TRUE(std::isfinite(tick.surface_velocity));
  ASSERT_LE(tick.force.norm(), max_force * (1.0 + 1e-12));
}

TEST(SightSafety, StaysFiniteAndWithinTheForceLimitOnWhateverCamerasAndHandsSend) {
  const auto clouds = hostile_clouds();
  for (unsigned seed = 1; seed <= (test::sanitized ? 1 : 8); ++seed) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<std::size_t> any(0, clouds.size() - 1);
    std::uniform_real_distribution<double> share(0.0, 1.0);
    Sight sight;
    double t = 0.0;
    for (int k = 0; k < 300; ++k) {
      // Mostly the plane, so that there is a contact to be upset.
      sight.observe({share(random) < 0.5 ? *clouds[0] : *clouds[any(random)],
                     share(random) < 0.05 ? std::numeric_limits<double>::quiet_NaN()
                                          : t - (share(random) < 0.1 ? 1.0 : 0.0)});
      for (int i = 0; i < 10; ++i) {
        t += share(random) < 0.01 ? 10.0 : 3e-3;
        const Vec3 hip = share(random) < 0.8 ? Vec3(0, 0, -0.01) : hostile_hip(random);
        expect_sane(sight.tick(hip, t));
        if (HasFatalFailure()) return;
      }
    }
  }
}

TEST(SightSafety, StaysFiniteOnPointsThatAreNoNumbers) {
  const PointCloud plane(test::flat_grid(0.0, 1.5e-3, 40), Vec3(0, 0, 1));
  for (const float value : {std::numeric_limits<float>::quiet_NaN(),
                            std::numeric_limits<float>::infinity(), 1e30F, -1e30F}) {
    const Garbage garbage(value);
    Sight sight;
    for (int k = 0; k < 30; ++k) {
      if (k % 3 == 2) {
        sight.observe({garbage, k * interval});
      } else {
        sight.observe({plane, k * interval});
      }
      for (int i = 0; i < 33; ++i) {
        expect_sane(sight.tick(Vec3(0, 0, k < 2 ? 0.02 : -0.01), k * interval + i * 1e-3));
        if (HasFatalFailure()) return;
      }
    }
  }
}

TEST(SightSafety, FeelsThePlaneAgainASecondAfterAnyHostileFrames) {
  const auto clouds = hostile_clouds();
  for (std::size_t hostile = 1; hostile < clouds.size(); ++hostile) {
    Sight sight;
    Tick tick{};
    for (int k = 0; k < 60; ++k) {
      sight.observe({k >= 20 && k < 25 ? *clouds[hostile] : *clouds[0], k * interval});
      for (int i = 0; i < 33; ++i) {
        const bool lifted = k < 3 || (k >= 25 && k < 32);
        tick = sight.tick(Vec3(0.0, 0.0, lifted ? 0.03 : -0.01), k * interval + i * 1e-3);
      }
    }
    EXPECT_NEAR(tick.force.z(), 6.0, 0.3) << "cloud " << hostile;
  }
}

TEST(SightSafety, NeitherAllocatesNorGathersMoreThanItsBounds) {
  const auto clouds = hostile_clouds();
  std::vector<Counted> all;
  all.reserve(clouds.size());
  for (const auto& cloud : clouds) all.emplace_back(*cloud);
  std::mt19937 random(3);
  std::uniform_int_distribution<std::size_t> any(0, clouds.size() - 1);
  Sight sight;
  const test::MemoryCalls calls;
  for (int k = 0; k < 200; ++k) {
    const Counted& cloud = k % 2 == 0 ? all[0] : all[any(random)];
    cloud.gathers = 0;
    cloud.beam_points = 0;
    sight.observe({cloud, k * interval});
    // A look along the beam, the contact near and far, beside it, and the audit.
    ASSERT_LE(cloud.gathers, 8);
    ASSERT_LE(cloud.beam_points, 8192U);
    for (int i = 0; i < 33; ++i) {
      const double t = k * interval + i * 1e-3;
      cloud.gathers = 0;
      const Tick tick = sight.tick(Vec3(0.02 * std::sin(7 * t), 0.02 * std::cos(5 * t), -0.01), t);
      ASSERT_LE(tick.steps, 64 + 8);
      ASSERT_LE(cloud.gathers, 64 + 32);
    }
  }
  if (test::memory_is_counted) {
    EXPECT_EQ(calls.count(), 0U);
  }
}

TEST(SightSafety, AsksForAFiniteForceAfterTwoFramesOfTheSameStamp) {
  // The interval between them is no interval: what a frame changes was blended over 0 seconds.
  const PointCloud plane(test::flat_grid(0.0, 1e-3, 40), Vec3(0, 0, 1));
  for (const double second : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    Sight sight;
    sight.observe({plane, 0.0});
    sight.observe({plane, second});
    for (int i = 0; i < 100; ++i) {
      const Tick tick = sight.tick({0, 0, 0.02 - 5e-4 * i}, 1e-3 * i);
      expect_sane(tick);
      EXPECT_NE(tick.flags & stamp_not_increasing, 0U);
    }
  }
}

}  // namespace test_sight_safety
}  // namespace palpate
