// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/observed_clouds.hpp"
#include "palpate/kernel/sight/fused_image.hpp"
#include "palpate/kernel/sight/sight.hpp"

namespace palpate {
namespace test_fused_image {

constexpr double distance = 0.6;  // [m] of the camera above the plane z = 0
constexpr double interval = 1.0 / 30.0;
constexpr double sigma = 2e-3;  // [m] of a pixel's noise
constexpr double r_c = 5e-3;

// A camera that looks straight down on heights above (x, y).
class Camera {
 public:
  explicit Camera(double side = 0.0) {
    Intrinsics k;
    k.width = 160;
    k.height = 120;
    k.fx = k.fy = 500.0;
    k.cx = 79.5;
    k.cy = 59.5;
    rays_ = std::make_shared<ViewingRays>(k);
    pose_.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
    pose_.translation() = Vec3(side, 0, distance);
  }

  using Height = std::function<double(double x, double y)>;
  const DepthImage& shoot(const Height& height, double noisy = sigma) {
    std::normal_distribution<double> noise(0.0, 1.0);
    std::vector<std::uint16_t> depth;
    const Intrinsics& k = rays_->intrinsics();
    for (int v = 0; v < k.height; ++v) {
      for (int u = 0; u < k.width; ++u) {
        const Eigen::Vector2d ray = rays_->ray(u, v);
        double z = distance;
        for (int i = 0; i < 30; ++i)
          z = 0.5 * (z + distance - height(z * ray.x() + pose_.translation().x(), -z * ray.y()));
        depth.push_back(static_cast<std::uint16_t>((z + noisy * noise(random_)) * 5e4 + 0.5));
      }
    }
    images_.push_back(std::make_unique<DepthImage>(rays_, std::move(depth), 5e4, pose_));
    return *images_.back();
  }

 private:
  std::mt19937 random_{5};
  std::shared_ptr<const ViewingRays> rays_;
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
  std::vector<std::unique_ptr<DepthImage>> images_;
};

double valley(double x, double /*y*/) { return std::abs(x); }

// The root mean square of what a fused image's points about a place are above a surface.
double error(const FusedImage& fused, const Camera::Height& height, const Vec3& place) {
  Patch patch;
  gather(fused, Ball{place, 8e-3}, patch);
  double sum = 0.0;
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const Vec3 p = place + Vec3(patch.x()[i], patch.y()[i], patch.z()[i]);
    sum += std::pow(p.z() - height(p.x(), p.y()), 2);
  }
  EXPECT_GT(patch.size(), 50U);
  return std::sqrt(sum / static_cast<double>(patch.size()));
}

void observe(FusedImage& fused, const DepthImage& image, int frame, const Vec3& place) {
  fused.observe(image,
                {.place = place,
                 .radius = 7e-3,
                 .stamp = frame * interval,
                 .interval = interval,
                 .sd = sigma / 10.0},
                {});
}

TEST(FusedImage, AveragesEachPixelOfAShapeThatIsNoQuadric) {
  Camera camera;
  FusedImage fused;
  for (int i = 0; i < 32; ++i) observe(fused, camera.shoot(valley), i, Vec3(0, 0, 2e-3));
  ASSERT_TRUE(fused.active());
  EXPECT_LT(error(fused, valley, Vec3(0, 0, 2e-3)), 1.5 * sigma / std::sqrt(32.0));
}

// Depth is rounded to the pitch of the pixels, so that all of a slope at 45 degrees is rounded
// alike: a median of it jumps by a good part of the step.
TEST(FusedImage, KeepsALevelStillThatIsFinerThanTheStepOfDepth) {
  constexpr int step = 60;  // units of depth: 1.2 mm
  Camera camera;
  FusedImage fused;
  std::vector<std::unique_ptr<DepthImage>> images;
  double level = 0.0;
  std::array<double, 2> range{};
  for (int i = 0; i < 160; ++i) {
    const DepthImage& image = camera.shoot(valley, 0.5 * sigma);
    std::vector<std::uint16_t> depth = image.depth().copy();
    for (std::uint16_t& each : depth)
      each = static_cast<std::uint16_t>((each + step / 2) / step * step);
    images.push_back(std::make_unique<DepthImage>(image.shared_rays(), std::move(depth), 5e4,
                                                  image.world_from_camera()));
    observe(fused, *images.back(), i, Vec3(0, 0, 2e-3));
    if (i < 32) continue;
    level += fused.correction().z();
    range = {std::min(range[0], level), std::max(range[1], level)};
  }
  EXPECT_LT(range[1] - range[0], 0.2e-3);
}

TEST(FusedImage, DoesNotTakeTheNoiseOfAPixelThatSaysItIsNoisyForAnotherSurface) {
  // A half of the valley has a tenth of the noise.
  std::array<double, 2> errors{};
  for (const bool is_told : {false, true}) {
    Camera quiet, noisy;
    FusedImage fused;
    double squares = 0.0;
    std::vector<std::unique_ptr<DepthImage>> images;
    for (int i = 0; i < 200; ++i) {
      const DepthImage& left = quiet.shoot(valley, 0.1 * sigma);
      std::vector<std::uint16_t> depth = left.depth().copy();
      const DepthImage& right = noisy.shoot(valley);
      std::vector<float> noise;
      for (std::size_t k = 0; k < depth.size(); ++k) {
        if (k % 160 >= 80) depth[k] = right.depth()[k];
        noise.push_back(static_cast<float>((k % 160 >= 80 ? 1.0 : 0.1) * sigma * 5e4));
      }
      images.push_back(std::make_unique<DepthImage>(left.shared_rays(), std::move(depth), 5e4,
                                                    left.world_from_camera()));
      if (is_told) images.back()->set_noise(noise);
      observe(fused, *images.back(), i, Vec3(0, 0, 2e-3));
      if (i >= 64) squares += std::pow(error(fused, valley, Vec3(8e-3, 0, 8e-3)), 2);
    }
    errors[is_told ? 1 : 0] = std::sqrt(squares / 136.0);
  }
  EXPECT_LT(errors[1], 1.3 * sigma / std::sqrt(64.0));
  EXPECT_GT(errors[0], 1.3 * errors[1]);
}

TEST(FusedImage, MovesAllPixelsWithASurfaceThatRises) {
  constexpr double speed = 0.05;  // [m/s]
  Camera camera;
  FusedImage fused;
  const auto rising = [](int frame) {
    return [rise = speed * std::max(frame - 15, 0) * interval](double x, double y) {
      return valley(x, y) + rise;
    };
  };
  for (int i = 0; i < 30; ++i)
    observe(fused, camera.shoot(rising(i)), i, Vec3(0, 0, 2e-3 + rising(i)(0, 0)));
  EXPECT_LT(error(fused, rising(29), Vec3(0, 0, rising(29)(0, 0))), 0.5 * sigma);
  EXPECT_NEAR(fused.displacement(29 * interval + 0.01).z(), 0.01 * speed, 0.002 * speed);
}

TEST(FusedImage, BeginsAgainWhereThreeFramesShowSomethingElse) {
  Camera camera;
  FusedImage fused;
  const auto stone = [](double x, double y) { return x > 4e-3 ? 0.03 : valley(x, y); };
  for (int i = 0; i < 20; ++i) observe(fused, camera.shoot(valley), i, Vec3(-3e-3, 0, 3e-3));
  for (int i = 20; i < 23; ++i) observe(fused, camera.shoot(stone), i, Vec3(-3e-3, 0, 3e-3));
  Patch patch;
  gather(fused, Ball{Vec3(0.01, 0, 0.01), 4e-3}, patch);
  EXPECT_EQ(patch.size(), 0U);  // nothing is left of what the stone covers
  gather(fused, Ball{Vec3(0.01, 0, 0.03), 6e-3}, patch);
  EXPECT_GT(patch.size(), 30U);
}

// The edge of a box 30 mm high passes under the contact. Half of the pixels then have a level of
// their own: the other half must not be put 30 mm above the box.
TEST(FusedImage, PutsNothingAboveABoxWhoseEdgePasses) {
  Camera camera;
  FusedImage fused;
  double edge = 0.02;
  for (int frame = 0; frame < 20; ++frame) {
    if (frame >= 8) edge -= 3e-3;
    const DepthImage& image =
        camera.shoot([&](double x, double) { return x > edge ? 0.03 : 0.0; }, 1e-4);
    observe(fused, image, frame, Vec3(0, 0, edge > 0.0 ? 0.0 : 0.03));
    Patch patch;
    gather(fused, Ball{Vec3(0, 0, 0.04), 0.05}, patch);
    for (std::size_t i = 0; i < patch.size(); ++i)
      ASSERT_LT(0.04 + patch.z()[i], 0.033) << "frame " << frame;
  }
}

TEST(FusedImage, KeepsAPixelThatFlickersAndDropsOneThatIsGone) {
  Camera camera;
  FusedImage fused;
  const Vec3 place(8e-3, 0, 8e-3);
  const auto points = [&] {
    Patch patch;
    gather(fused, Ball{Vec3(0, 0, 1e-3), 2.5e-3}, patch);
    return patch.size();
  };
  int frame = 0;
  for (; frame < 10; ++frame) observe(fused, camera.shoot(valley), frame, place);
  const std::size_t whole = points();
  EXPECT_GT(whole, 10U);
  const DepthImage& last = camera.shoot(valley);
  std::vector<std::uint16_t> holed = last.depth().copy();
  for (std::size_t i = 0; i < holed.size(); ++i)
    if (i % 160 >= 76 && i % 160 < 84) holed[i] = 0;
  const DepthImage gone(last.shared_rays(), holed, 5e4, last.world_from_camera());
  for (int i = 0; i < 3; ++i) observe(fused, gone, frame++, place);
  EXPECT_EQ(points(), whole);
  observe(fused, gone, frame++, place);
  EXPECT_EQ(points(), 0U);
}

TEST(FusedImage, BeginsAgainWhereAFrameShowsWhatIsFarBehind) {
  Camera camera;
  FusedImage fused;
  for (int i = 0; i < 12; ++i) {
    const double floor = i < 8 ? 0.0 : -0.3;
    observe(fused, camera.shoot([=](double x, double y) { return valley(x, y) + floor; }), i,
            Vec3(0, 0, 2e-3));
    EXPECT_LT(fused.correction().norm(), 5e-3) << i;
    EXPECT_LT(fused.displacement((i + 1) * interval).norm(), 5e-3) << i;
  }
}

TEST(FusedImage, BeginsAgainWhenTheCameraMoves) {
  Camera first;
  Camera second(0.01);
  FusedImage fused;
  observe(fused, first.shoot(valley), 0, Vec3(0, 0, 2e-3));
  observe(fused, first.shoot(valley), 1, Vec3(0, 0, 2e-3));
  EXPECT_TRUE(fused.active());
  observe(fused, second.shoot(valley), 2, Vec3(0, 0, 2e-3));
  EXPECT_FALSE(fused.active());
}

TEST(FusedImage, FollowsAContactThatSlidesAndLeavesTheImage) {
  Camera camera;
  FusedImage fused;
  const auto groove = [](double, double y) { return std::abs(y); };
  for (int i = 0; i < 60; ++i) {
    const Vec3 place(-0.11 + 4e-3 * i, 0, 1e-3);
    observe(fused, camera.shoot(groove), i, place);
    // At the image's edges too: what is there must be right.
    if (std::abs(place.x()) > 0.08) continue;
    EXPECT_LT(error(fused, groove, place), 0.7 * sigma) << i;
  }
}

// The largest way [m] of the proxy along an axis while a hand rests in a valley.
double shake(double noisy) {
  Camera camera;
  Sight sight;
  sight.seat(Vec3(1e-3, 0, 0.03));
  Vec3 low = Vec3::Constant(1.0);
  Vec3 high = Vec3::Constant(-1.0);
  for (int i = 0; i < 90; ++i) {
    sight.observe({camera.shoot(valley, noisy), i * interval});
    for (int k = 0; k < 33; ++k) {
      const double t = i * interval + k * 1e-3;
      const Tick tick = sight.tick(Vec3(1e-3, 0, std::max(0.03 - 0.05 * t, -4e-3)), t);
      if (t < 2.0) continue;
      EXPECT_EQ(tick.state, ContactState::contact);
      EXPECT_NEAR(tick.proxy.z(), std::sqrt(2.0) * r_c, 0.8e-3);
      low = low.cwiseMin(tick.proxy);
      high = high.cwiseMax(tick.proxy);
    }
  }
  return (high - low).maxCoeff();
}

TEST(FusedImage, LetsTheProxyRestInAConcaveCornerBeforeANoisyCamera) {
  EXPECT_LT(shake(0.0), 0.02e-3);
  EXPECT_LT(shake(sigma), 0.3e-3);
}

}  // namespace test_fused_image
}  // namespace palpate
