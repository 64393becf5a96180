// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/kernel/sight/sight.hpp"
#include "palpate/kernel/sight/tracker.hpp"

#include "tests/support/grids.hpp"

namespace palpate {
namespace test_sight {

using test::flat_grid;
using test::grid;

constexpr double r_c = 5e-3;
constexpr double interval = 1.0 / 30.0;

Sight seated(const Vec3& seat) {
  Sight sight;
  sight.seat(seat);
  return sight;
}

using HipPath = std::function<Vec3(double t)>;

// One frame and its ticks; the last one.
Tick live_through(Method& method, const Cloud& cloud, double stamp, const HipPath& hip) {
  method.observe({cloud, stamp});
  Tick tick;
  for (int i = 0; i < 33; ++i) tick = method.tick(hip(stamp + i * 1e-3), stamp + i * 1e-3);
  return tick;
}

// A grid as one frame of a camera a metre above it sees it, each coordinate with noise.
PointCloud seen_from_above(std::vector<Vec3> points, double sigma, std::mt19937& random) {
  if (sigma > 0.0) {
    std::normal_distribution<double> noise(0.0, sigma);
    for (Vec3& p : points) p += Vec3(noise(random), noise(random), noise(random));
  }
  const double z = points.empty() ? 0.0 : points[points.size() / 2].z();
  return PointCloud(points, Vec3(0, 0, z + 1.0));
}

// A camera 0.6 m above the plane z = 0, which reads the heights it is given.
class Overhead {
 public:
  static constexpr double distance = 0.6;

  Overhead() {
    Intrinsics k;
    k.width = 160;
    k.height = 120;
    k.fx = k.fy = 400.0;
    k.cx = 79.5;
    k.cy = 59.5;
    rays_ = std::make_shared<ViewingRays>(k);
    pose_.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
    pose_.translation() = Vec3(0, 0, distance);
  }

  template <class Height>
  [[nodiscard]] DepthImage shoot(const Height& height, double sigma, std::mt19937& random) const {
    std::normal_distribution<double> noise(0.0, 1.0);
    std::vector<std::uint16_t> depth;
    for (int v = 0; v < 120; ++v) {
      for (int u = 0; u < 160; ++u) {
        const Eigen::Vector2d ray = rays_->ray(u, v);
        double z = distance;
        for (int i = 0; i < 4; ++i) z = distance - height(z * ray.x(), -z * ray.y());
        depth.push_back(static_cast<std::uint16_t>((z + sigma * noise(random)) * 5e4 + 0.5));
      }
    }
    return DepthImage(rays_, std::move(depth), 5e4, pose_);
  }

 private:
  std::shared_ptr<const ViewingRays> rays_;
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
};

TEST(SurfaceFit, FindsTheQuadricThatItsPointsLieOn) {
  Quadric truth;
  truth.c << 0.002, 0.1, -0.2, 5.0, -3.0, 8.0;
  const auto points = grid(1e-3, 12, [&](double x, double y) { return truth.height(Vec2(x, y)); });
  Patch patch;
  gather(BruteForceCloud(points), Ball{Vec3(0, 0, 0.001), 0.03}, patch);
  const Moments moments =
      disc_moments(patch, LocalFrame{}, Quadric{}, Disc{Vec2::Zero(), 0.0, 0.011, 10.0}, 0.01);
  const Quadric found = fit_quadric(moments, 0.0, 0.01);
  for (const Vec2& at : {Vec2(0, 0), Vec2(0.004, -0.003), Vec2(-0.01, 0.002)}) {
    EXPECT_NEAR(found.height(at), truth.height(at), 1e-7);
  }
}

TEST(SurfaceFit, SaysTheSameAboutAnotherOrigin) {
  Quadric surface;
  surface.c << 0.001, 0.05, 0.1, 3.0, 1.0, -2.0;
  const auto points =
      grid(1e-3, 10, [&](double x, double y) { return surface.height(Vec2(x, y)); });
  Patch patch;
  gather(BruteForceCloud(points), Ball{Vec3::Zero(), 0.02}, patch);
  const Moments here =
      disc_moments(patch, LocalFrame{}, Quadric{}, Disc{Vec2::Zero(), 0.0, 0.009, 10.0}, 0.01);
  const Vec3 shift(0.003, -0.002, 0.004);
  const Quadric there = fit_quadric(here.moved(shift / 0.01), 0.0, 0.01);
  for (const Vec2& at : {Vec2(0, 0), Vec2(0.004, -0.003)}) {
    EXPECT_NEAR(there.height(at), surface.height(at + shift.head<2>()) - shift.z(), 2e-7);
  }
}

TEST(SurfaceFit, FindsTheKthSmallestAsSortingDoes) {
  std::mt19937 random(11);
  std::normal_distribution<float> height(0.0F, 2e-3F);
  for (const std::size_t size : {1, 2, 8, 37, 192}) {
    std::vector<float> values(size);
    // Every other time in steps, as quantised depth has them: many are equal.
    for (const float step : {0.0F, 1e-3F}) {
      for (float& value : values) {
        value = height(random);
        if (step > 0.0F) value = step * std::round(value / step);
      }
      std::vector<float> sorted = values;
      std::sort(sorted.begin(), sorted.end());
      for (std::size_t k = 0; k < size; k += 1 + size / 7)
        EXPECT_EQ(kth_smallest(values, k), sorted[k]) << k << " of " << size;
    }
  }
}

TEST(SurfaceFit, FindsTheNearestPointOfABowl) {
  Quadric bowl;
  bowl.c << 0, 0, 0, 10.0, 0, 10.0;  // radius of curvature 50 mm
  const Vec3 point(0.004, 0.003, 0.02);
  const Vec2 at = bowl.nearest(point, point.head<2>(), Vec2::Zero(), 1.0);
  const Vec3 foot(at.x(), at.y(), bowl.height(at));
  EXPECT_LT((point - foot).cross(bowl.normal(at)).norm(), 1e-9);
}

std::vector<HeightSample> heights_of(const std::vector<double>& oldest_first) {
  std::vector<HeightSample> samples;
  for (std::size_t i = oldest_first.size(); i-- > 0;) {
    samples.push_back({static_cast<double>(i) * interval, oldest_first[i]});
  }
  return samples;
}

TEST(AgreedHeight, IsTheMeanOfASurfaceAtRest) {
  const auto samples = heights_of({1e-3, -1e-3, 1e-3, -1e-3, 1e-3, -1e-3, 1e-3, -1e-3});
  EXPECT_NEAR(agreed_height(samples, 1e-3, 2.5), 0.0, 1e-12);
}

TEST(AgreedHeight, LetsGoOfThePastInOneFrameWhenTheSurfaceJumps) {
  const auto samples = heights_of({0, 0, 0, 0, 0, 0, 0, 0.1});
  EXPECT_NEAR(agreed_height(samples, 1e-4, 2.5), 0.1, 2.5e-4);
}

TEST(AgreedHeight, CountsADoubtfulHeightForLittle) {
  auto samples = heights_of({0, 0, 0, 0, 0, 0, 0, 4e-3});
  const double sure = agreed_height(samples, 1e-3, 3.0);
  EXPECT_GT(sure, 0.9e-3);
  samples.front().doubt = 4.0;
  EXPECT_NEAR(agreed_height(samples, 1e-3, 3.0), 4e-3 / 29.0, 1e-9) << "the weighted mean";
}

TEST(HeightTrack, HasNoVelocityAtRestUnderNoiseAndTheRightOneInSteadyMotion) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 1e-3);
  int moving = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<double> heights;
    for (int i = 0; i < 32; ++i) heights.push_back(noise(random));
    if (track_height(heights_of(heights), 1e-3, interval).velocity != 0.0) ++moving;
  }
  EXPECT_LE(moving, 2);
  const auto rising = heights_of({0.000, 0.001, 0.002, 0.003, 0.004});
  EXPECT_NEAR(track_height(rising, 1e-5, interval).velocity, 0.03, 1e-7);
}

// Hazard: not-a-number
TEST(HeightTrack, IsANumberWhereAStampIsOfAnotherClock) {
  for (const double jump : {1.0, 1e3, 1e6, 1e12}) {
    for (int when = 1; when < 20; ++when) {
      std::vector<HeightSample> newest_first;
      for (int i = 20; i-- > 0;)
        newest_first.push_back({i * interval + (i == when ? jump : 0.0), 1e-3 * (i % 3)});
      const HeightTrack track = track_height(newest_first, 1e-3, interval);
      EXPECT_LT(std::abs(track.height), 3e-3) << jump << " s at frame " << when;
      EXPECT_LT(std::abs(track.velocity), 0.5);
    }
  }
}

TEST(HeightTrack, TakesNoMotionFromASingleFrameThatMayBeABadOne) {
  // In some minutes of pressing a frame is this far off. [m], of noise of 1 mm
  const auto after_rest = [](std::vector<double> newest) {
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, 1e-3);
    std::vector<double> heights;
    for (int i = 0; i < 32; ++i) heights.push_back(noise(random));
    heights.insert(heights.end(), newest.begin(), newest.end());
    return track_height(heights_of(heights), 1e-3, interval);
  };
  const HeightTrack bad = after_rest({4.5e-3});
  EXPECT_EQ(bad.velocity, 0.0);
  EXPECT_LT(bad.height, 2.5e-3) << "three standard deviations from the newest are 1.5 mm";
  EXPECT_LT(after_rest({4.5e-3, 0.0}).height, 1e-3);
  // The frame after it proves a motion, and so does one that is far off.
  EXPECT_GT(after_rest({4.5e-3, 9e-3}).velocity, 0.08);
  EXPECT_NEAR(after_rest({4.5e-3, 9e-3}).height, 9e-3, 1e-3);
  EXPECT_GT(after_rest({8e-3}).velocity, 0.05);
  EXPECT_NEAR(after_rest({8e-3}).height, 8e-3, 1.1e-3);
}

// What a disc's noise is taken for after 12 frames of a plane that lies higher or lower by some
// `jitter` [m] in each, with points that scatter by `scatter` [m] about it and a foot that slides
// by `stride` [m] a frame.
double noise_of(double jitter, double scatter, double stride) {
  SurfaceEstimate estimate;
  estimate.set_distance(0, 0.5);
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int frame = 0; frame < 12; ++frame) {
    const double z = jitter * normal(random);
    const PointCloud plane(
        test::grid(2e-3, 70, [&](double, double) { return z + scatter * normal(random); }));
    estimate.start_frame(0, frame * interval, interval);
    if (frame == 0) {
      EXPECT_TRUE(estimate.start(plane, Vec3(0, 0, 0), Vec3::UnitZ()));
    } else {
      const Vec2 foot = estimate.frame().local_from_world(Vec3(frame * stride, 0, 0)).head<2>();
      EXPECT_TRUE(estimate.add(plane, foot, {.gate = 60e-3}));
    }
  }
  return estimate.beam_sd();
}

TEST(SurfaceEstimate, TakesANarrowDiscForAtLeastAsNoisyAsAWiderOneIs) {
  // Only wide discs see the same place often enough to measure noise.
  constexpr double jitter = 6e-3;  // [m]
  EXPECT_GT(noise_of(jitter, 0.5 * jitter, 4e-3), 0.5 * jitter)
      << "the usual noise at 0.5 m is 1.25 mm";
}

TEST(SurfaceEstimate, TakesWhatMovesAllPointsAlikeForMotion) {
  constexpr double scatter = 0.3e-3;  // [m]
  EXPECT_LT(noise_of(6e-3, scatter, 0.0), 4.0 * scatter) << "a camera that shakes has no noise";
}

TEST(FirstLayer, IsTheNearestOneThatEnoughPointsBelongTo) {
  std::array<float, 20> heights;
  for (std::size_t i = 0; i < 9; ++i) heights[i] = 0.10F + 1e-4F * static_cast<float>(i);
  for (std::size_t i = 9; i < 19; ++i) heights[i] = -1e-4F * static_cast<float>(i);
  heights[19] = 0.2F;  // a stray point
  const auto layer = first_layer(heights, 0.02, 0.3);
  ASSERT_TRUE(layer);
  EXPECT_NEAR(layer->height, 0.1004, 1e-6);
  EXPECT_FALSE(first_layer(std::span(heights.data(), 4), 0.02, 0.3));
}

TEST(Sight, RestsExactlyOneContactRadiusAboveAPlaneWithoutNoise) {
  std::mt19937 random(1);
  const PointCloud plane = seen_from_above(flat_grid(), 0.0, random);
  Sight sight = seated({0, 0, 0.02});
  Tick tick{};
  for (int k = 0; k < 4; ++k) {
    tick = live_through(sight, plane, k * interval,
                        [](double) { return Vec3(0.0003, 0.0004, -0.01); });
    EXPECT_NEAR(tick.proxy.z(), r_c, 1e-6);
  }
  EXPECT_NEAR(tick.force.z(), 6.0, 1e-2);
}

TEST(Sight, FeelsAWedgeAndAGapAsPointsBecauseTheyAreNotSmooth) {
  std::mt19937 random(1);
  const PointCloud wedge =
      seen_from_above(grid(1e-3, 60, [](double x, double) { return std::abs(x); }), 0.0, random);
  Sight sight = seated({0, 0, 0.03});
  Tick tick{};
  for (int k = 0; k < 5; ++k) {
    tick = live_through(sight, wedge, k * interval, [](double) { return Vec3(0, 0, -0.01); });
  }
  EXPECT_NEAR(tick.proxy.z(), r_c * std::numbers::sqrt2, 0.2e-3);

  std::vector<Vec3> rims;
  for (const Vec3& p : flat_grid(0.0, 1e-3, 60)) {
    if (std::abs(p.x()) >= 3e-3) rims.push_back(p);
  }
  const PointCloud gap = seen_from_above(rims, 0.0, random);
  sight = seated({0, 0, 0.03});
  for (int k = 0; k < 5; ++k) {
    tick = live_through(sight, gap, k * interval, [](double) { return Vec3(0, 0, -0.02); });
  }
  EXPECT_NEAR(tick.proxy.z(), std::sqrt(r_c * r_c - 9e-6), 0.2e-3);
}

TEST(Sight, RestsOnASheetTouchedFromBehind) {
  std::mt19937 random(2);
  Sight sight = seated({0, 0, -0.03});
  Tick tick{};
  for (int k = 0; k < 10; ++k) {
    const PointCloud sheet = seen_from_above(flat_grid(), 0.2e-3, random);
    tick = live_through(sight, sheet, k * interval, [](double) { return Vec3(0, 0, 0.01); });
  }
  EXPECT_NEAR(tick.proxy.z(), -r_c, 0.5e-3);
  EXPECT_LT(tick.force.z(), -5.0);
}

// A flat plane whose readings are ten times as noisy where `is_noisy(u, frame)`, and what the
// camera says of that.
struct NoisyPlane {
  static constexpr double sigma = 0.4e-3;  // [m]
  std::function<bool(int u, int frame)> is_noisy;
  bool is_told;
  double said = 1.0;  // [-] of the noise that there is

  [[nodiscard]] DepthImage shoot(int frame, std::mt19937& random) const {
    std::normal_distribution<double> normal(0.0, 1.0);
    std::vector<float> noise;
    const DepthImage still = camera.shoot([](double, double) { return 0.0; }, 0.0, random);
    std::vector<std::uint16_t> depth = still.depth().copy();
    for (std::size_t i = 0; i < depth.size(); ++i) {
      const double of = (is_noisy(static_cast<int>(i % 160), frame) ? 10.0 : 1.0) * sigma * 5e4;
      noise.push_back(static_cast<float>(said * of));
      depth[i] = static_cast<std::uint16_t>(depth[i] + of * normal(random) + 0.5);
    }
    DepthImage image(still.shared_rays(), std::move(depth), 5e4, still.world_from_camera());
    if (is_told) image.set_noise(noise);
    return image;
  }
  // Of a resting hand 6 mm deep [m rms]: how far off the truth the proxy is, and how it leans [-].
  struct Errors {
    double height = 0.0, lean = 0.0;
  };
  [[nodiscard]] Errors errors(unsigned seeds) const {
    double squares = 0.0, leans = 0.0, count = 0.0;
    for (unsigned seed = 1; seed <= seeds; ++seed) {
      std::mt19937 random(seed);
      Sight sight = seated({0, 0, 0.03});
      for (int k = 0; k < 40; ++k) {
        const DepthImage image = shoot(k, random);
        const Tick tick = live_through(sight, image, k * interval, [](double t) {
          return Vec3(0, 0, std::max(0.03 - 0.1 * t, -6e-3));
        });
        EXPECT_TRUE(tick.force.allFinite());
        if (k < 25) continue;
        squares += std::pow(tick.proxy.z() - r_c, 2);
        leans += tick.normal.head<2>().squaredNorm();
        ++count;
      }
    }
    return {std::sqrt(squares / count), std::sqrt(leans / count)};
  }
  Overhead camera{};
};

TEST(Sight, LeansOnTheHalfOfAnImageThatSaysItIsQuiet) {
  const auto half = [](int u, int /*frame*/) { return u >= 80; };
  const NoisyPlane::Errors untold = NoisyPlane{half, false}.errors(10);
  const NoisyPlane::Errors told = NoisyPlane{half, true}.errors(10);
  EXPECT_LT(told.height, 0.5 * untold.height);
  EXPECT_LT(told.lean, 0.5 * untold.lean);
}

TEST(Sight, IsMovedLessByFramesThatSayTheyAreNoisy) {
  const auto now_and_then = [](int /*u*/, int frame) { return frame % 4 == 3; };
  const NoisyPlane::Errors untold = NoisyPlane{now_and_then, false}.errors(10);
  const NoisyPlane::Errors told = NoisyPlane{now_and_then, true}.errors(10);
  EXPECT_LT(told.height, 0.5 * untold.height);
}

TEST(Sight, IsNotMisledByAnImageThatIsTooSureOfItselfOrNotEnough) {
  const auto nowhere = [](int /*u*/, int /*frame*/) { return false; };
  const NoisyPlane::Errors untold = NoisyPlane{nowhere, false}.errors(5);
  for (const double said : {0.1, 10.0}) {
    const NoisyPlane::Errors told = NoisyPlane{nowhere, true, said}.errors(5);
    EXPECT_NEAR(told.height, untold.height, 0.1 * untold.height) << said;
    EXPECT_NEAR(told.lean, untold.lean, 0.1 * untold.lean) << said;
  }
}

TEST(Sight, RestsOnReadingsThatSayTheyAreWithoutNoise) {
  // All of them, or one in a few, which then decide alone.
  for (const int each : {1, 9}) {
    std::mt19937 random(3);
    Sight sight = seated({0, 0, 0.02});
    Tick tick{};
    for (int k = 0; k < 10; ++k) {
      DepthImage image = Overhead().shoot([](double, double) { return 0.0; }, 0.3e-3, random);
      std::vector<float> noise(image.depth().size(), 1e4F);
      for (std::size_t i = 0; i < noise.size(); i += static_cast<std::size_t>(each)) noise[i] = 0;
      image.set_noise(noise);
      tick = live_through(sight, image, k * interval, [](double) { return Vec3(0, 0, -6e-3); });
      ASSERT_TRUE(tick.force.allFinite());
    }
    EXPECT_NEAR(tick.proxy.z(), r_c, 0.3e-3) << each;
    EXPECT_NEAR(tick.force.z(), 600.0 * 6e-3, 0.2) << each;
  }
}

struct Lift {
  double acceleration, sigma;  // [m/s^2], [m]
};

// Section 5.2's experiment, on a smaller grid. True if the proxy is above the surface at its end.
bool is_held(const Lift& lift, std::string_view name, unsigned seed) {
  std::mt19937 random(seed);
  const auto method = make_method(name);
  method->seat({0, 0, 0});
  const auto height = [&](double t) {
    const double after = std::max(t - 0.5, 0.0);
    return -0.05 + 0.1 * t + 0.5 * lift.acceleration * after * after;
  };
  for (int k = 0; k <= 26; ++k) {
    const double t = k * interval;
    const PointCloud cloud = seen_from_above(flat_grid(height(t), 1.5e-3, 40), lift.sigma, random);
    const Tick tick = live_through(*method, cloud, t, [&](double now) {
      return Vec3(0, 0, now < 0.5 ? 0.0 : height(now) - 6 * r_c);
    });
    if (k > 15 && tick.proxy.z() < height(t)) return false;
  }
  return true;
}

TEST(Sight, HoldsLiftsThatThePapersMethodLoses) {
  int lost_by_paper = 0;
  unsigned seed = 1;
  for (const Lift& lift :
       {Lift{600 * r_c, 0.6 * r_c}, Lift{1400 * r_c, 0.0}, Lift{1400 * r_c, 3.0 * r_c},
        Lift{1000 * r_c, 1.5 * r_c}, Lift{10000 * r_c, 0.2 * r_c}, Lift{18000 * r_c, 1.0 * r_c}}) {
    EXPECT_TRUE(is_held(lift, "sight", seed)) << lift.acceleration << " " << lift.sigma;
    if (!is_held(lift, "paper", seed)) ++lost_by_paper;
    ++seed;
  }
  EXPECT_GE(lost_by_paper, 4);
}

TEST(Sight, MeetsASurfaceThatComesFromFreeSpaceAtAnySpeed) {
  for (const double speed : {0.1, 0.2, 1.0, 5.0}) {
    std::mt19937 random(5);
    Sight sight = seated({0, 0, 0});
    for (int k = 0; k < 40; ++k) {
      const double z = -0.15 * std::max(1.0, speed) + 0.003 + speed * k * interval;
      if (z > 0.1) break;
      const PointCloud cloud = seen_from_above(flat_grid(z, 1.5e-3, 40), 1e-3, random);
      const Tick tick =
          live_through(sight, cloud, k * interval, [](double) { return Vec3(0, 0, 0); });
      if (z > 0) {
        EXPECT_GT(tick.proxy.z(), z) << "at " << speed << " m/s";
      }
    }
  }
}

TEST(Sight, HoldsTheContactWhileAHandPassesBeforeIt) {
  const Overhead camera;
  for (const double speed : {0.3, 0.9, 1.7}) {
    std::mt19937 random(3);
    Sight sight = seated({0, 0, 0.03});
    bool hidden = false;
    double lowest = 1.0;
    double highest = 0.0;
    for (int k = 0; k < 60; ++k) {
      const double edge = -0.2 + speed * std::max(k - 20, 0) * interval;
      const DepthImage image = camera.shoot(
          [&](double x, double) { return std::abs(x - edge) < 0.04 ? 0.1 : 0.0; }, 1e-3, random);
      const Tick tick =
          live_through(sight, image, k * interval, [](double) { return Vec3(0, 0, -0.01); });
      hidden = hidden || (tick.flags & surface_hidden) != 0;
      if (k < 10) continue;
      lowest = std::min(lowest, tick.proxy.z());
      highest = std::max(highest, tick.proxy.z());
    }
    EXPECT_TRUE(hidden) << speed;
    EXPECT_GT(lowest, r_c - 0.5e-3) << speed;
    EXPECT_LT(highest, r_c + 0.5e-3) << speed;
  }
}

TEST(Sight, HoldsTheContactWhenSomethingCoversAllThatIsSeenWithinAFrame) {
  const Overhead camera;
  std::mt19937 random(3);
  Sight sight = seated({0, 0, 0.03});
  for (int k = 0; k < 40; ++k) {
    const double height = k >= 20 && k < 25 ? 0.1 : 0.0;
    const DepthImage image = camera.shoot([&](double, double) { return height; }, 1e-3, random);
    const Tick tick =
        live_through(sight, image, k * interval, [](double) { return Vec3(0, 0, -0.01); });
    if (k < 15) continue;
    EXPECT_EQ((tick.flags & surface_hidden) != 0, height > 0.0) << "frame " << k;
    EXPECT_NEAR(tick.proxy.z(), r_c, 0.2e-3) << "frame " << k;
    EXPECT_NEAR(tick.force.z(), 6.0, 0.2) << "frame " << k;
  }
}

// A box is put below a hovering hand and hides the table that was followed behind it. The hand
// comes down on the box and stays.
TEST(Sight, KeepsTheForceOfWhatHidTheSurfaceThatWasFollowedBeforeTheContact) {
  constexpr double top = 0.015;  // [m]
  const Overhead camera;
  std::mt19937 random(3);
  Sight sight = seated({0, 0, 0.025});
  const auto hip = [](double t) {
    return Vec3(0, 0, std::max(0.025 - 0.05 * std::max(t - 0.7, 0.0), top - 0.004));
  };
  for (int k = 0; k < 75; ++k) {
    const DepthImage image = camera.shoot(
        [&](double x, double y) {
          return k >= 12 && std::max(std::abs(x), std::abs(y)) < 0.03 ? top : 0.0;
        },
        1e-3, random);
    const Tick tick = live_through(sight, image, k * interval, hip);
    if (k * interval > 1.1) {
      EXPECT_NEAR(tick.force.z(), 2.4, 0.3) << "frame " << k;
    }
  }
}

// Before a slow camera a visitor is there in one frame, everywhere, and gone in another. The hand,
// pressed in, moves on meanwhile: it must be neither numb afterwards nor held when it lifts.
TEST(Sight, KnowsASlowCamerasVisitorFromTheSurface) {
  constexpr double slow = 0.3;  // [s] between frames: too far apart to tell a motion
  const Overhead camera;
  for (const int visit : {1, 3}) {  // [frames]
    std::mt19937 random(2);
    const auto shoot = [&](double height) {
      return camera.shoot([=](double, double) { return height; }, 2e-3, random);
    };
    Sight sight = seated({0, 0, 0.03});
    Tick tick;
    double pressed = 0.0;
    double last = 0.0;
    for (int i = 0; i < 20; ++i) {
      const DepthImage image = shoot(i >= 6 && i < 6 + visit ? 0.35 : 0.0);
      sight.observe({image, i * slow});
      for (int k = 0; k < 300; ++k) {
        const double t = i * slow + k * 1e-3;
        const double lifted = std::max(0.0, 0.1 * (t - 17 * slow));  // [m]
        tick =
            sight.tick({0.02 * std::sin(3.0 * t), 0, std::max(0.03 - 0.1 * t, -6e-3) + lifted}, t);
        EXPECT_GT(tick.force.z(), -0.05) << t;
        if (i == 5) pressed = tick.force.z();
        if (i == 16) last = tick.force.z();
      }
    }
    EXPECT_GT(pressed, 2.0);
    EXPECT_NEAR(last, pressed, 0.4) << visit;
    EXPECT_EQ(tick.force.norm(), 0.0);
  }
}

TEST(Sight, LetsAHandOutOfTheShadowOfWhatCameBesideIt) {
  // A tall box slides up to a pressing hand off the camera's axis and hides it: its shadow reaches
  // 5 to 10 mm beyond the hand. As the hand lifts, it comes out of the shadow beside the box.
  const Overhead camera;
  for (const double height : {0.1, 0.15, 0.2}) {
    for (const double reach : {0.075, 0.08}) {
      std::mt19937 random(6);
      Sight sight = seated({0.07, 0, 0.03});
      bool hidden = false;
      double strongest = 0.0;
      for (int k = 0; k < 75; ++k) {
        const double shadow = std::min(-0.2 + 0.4 * std::max(k - 15, 0) * interval, reach);
        const DepthImage image =
            camera.shoot([&](double x, double) { return x < shadow ? height : 0.0; }, 0.0, random);
        sight.observe({image, k * interval});
        for (int i = 0; i < 33; ++i) {
          const double t = k * interval + i * 1e-3;
          const double up = std::max(t - 1.6, 0.0) * 0.3;
          const Tick tick = sight.tick(Vec3(0.07, 0, std::min(-0.006 + up, 0.25)), t);
          hidden = hidden || (tick.flags & surface_hidden) != 0;
          if (tick.hip.z() > 0.01) strongest = std::max(strongest, tick.force.norm());
        }
      }
      EXPECT_TRUE(hidden) << height << ' ' << reach;
      EXPECT_LT(strongest, 0.05) << height << ' ' << reach;
    }
  }
}

TEST(Sight, HoldsTheContactBesideAShadowWithoutPoints) {
  // Stereo sees nothing beside an occluder: a hole comes over the contact, half of it first.
  const Overhead camera;
  std::mt19937 random(4);
  Sight sight = seated({0, 0, 0.03});
  for (int k = 0; k < 60; ++k) {
    const double edge = -0.04 + 0.003 * std::max(k - 20, 0);
    const DepthImage image = camera.shoot(
        [&](double x, double) { return std::abs(x - edge) < 0.02 ? Overhead::distance : 0.0; }, 0.0,
        random);
    const Tick tick =
        live_through(sight, image, k * interval, [](double) { return Vec3(0, 0, -0.01); });
    EXPECT_NEAR(tick.proxy.z(), r_c, 0.2e-3) << "frame " << k;
  }
}

TEST(Sight, KeepsToTheFlanksOfReliefFinerThanTheProxy) {
  // Sine waves 3 mm high and 10 mm long. The proxy's centre is where it touches without entering.
  const Overhead camera;
  std::mt19937 random(5);
  const auto height = [](double x) { return 1.5e-3 * std::cos(200.0 * std::numbers::pi * x); };
  const auto rest = [&](double x) {
    double z = -1.0;
    for (double d = -r_c; d <= r_c; d += 2e-5) {
      z = std::max(z, height(x + d) + std::sqrt(std::max(r_c * r_c - d * d, 0.0)));
    }
    return z;
  };
  const DepthImage image = camera.shoot([&](double x, double) { return height(x); }, 0.0, random);
  Sight sight = seated({-0.01, 0.0003, 0.03});
  double squares = 0.0;
  int ticks = 0;
  for (int k = 0; k < 60; ++k) {
    sight.observe({image, k * interval});
    for (int i = 0; i < 33; ++i) {
      const double t = k * interval + i * 1e-3;
      const Tick tick = sight.tick(Vec3(-0.01 + 0.01 * t, 0.0003, -0.01), t);
      if (k < 10) continue;
      squares += std::pow(tick.proxy.z() - rest(tick.proxy.x()), 2);
      ++ticks;
    }
  }
  // Between points 1.5 mm apart a sphere sinks by up to 0.11 mm.
  EXPECT_LT(std::sqrt(squares / ticks), 0.15e-3);
}

TEST(Sight, LetsTheForceFadeWhenTheSurfaceStaysHidden) {
  const Overhead camera;
  std::mt19937 random(3);
  Sight sight = seated({0, 0, 0.03});
  Tick tick{};
  for (int k = 0; k < 60; ++k) {
    const double edge =
        -0.15 + 0.5 * std::clamp(k - 10, 0, 9) * interval;  // stops over the contact
    const DepthImage image = camera.shoot(
        [&](double x, double) { return std::abs(x - edge) < 0.04 ? 0.1 : 0.0; }, 0.0, random);
    tick = live_through(sight, image, k * interval, [](double) { return Vec3(0, 0, -0.01); });
    if (k == 9) {
      EXPECT_NEAR(tick.force.z(), 6.0, 0.1);
    }
  }
  EXPECT_TRUE(tick.flags & surface_hidden);
  EXPECT_NEAR(tick.force.norm(), 0.0, 1e-6);
  EXPECT_NEAR(tick.proxy.z(), r_c, 0.1e-3);
}

TEST(Sight, AveragesTheNoiseOfASurfaceAtRestAway) {
  const Overhead camera;
  std::mt19937 random(4);
  Sight sight = seated({0, 0, 0.03});
  for (int k = 0; k < 30; ++k) {
    const DepthImage image = camera.shoot([](double, double) { return 0.0; }, 1e-3, random);
    const Tick tick =
        live_through(sight, image, k * interval, [](double) { return Vec3(0.0002, 0, -0.01); });
    if (k >= 8) {
      EXPECT_NEAR(tick.proxy.z(), r_c, 0.15e-3) << "frame " << k;
      EXPECT_EQ(tick.surface_velocity, 0.0) << "frame " << k;
    }
  }
}

TEST(Sight, SaysTheSurfacesVelocityAlongItsNormal) {
  // A leaning plane that rises: along the line of sight it is faster than along its normal.
  const Overhead camera;
  std::mt19937 random(6);
  constexpr double slope = 0.7;
  constexpr double speed = 0.03;  // [m/s] along z
  Sight sight = seated({0, 0, 0.03});
  Tick tick;
  for (int k = 0; k < 20; ++k) {
    const double t = k * interval;
    const DepthImage image =
        camera.shoot([&](double x, double) { return slope * x + speed * t; }, 0.0, random);
    tick = live_through(sight, image, t, [](double now) { return Vec3(0, 0, speed * now - 0.01); });
  }
  EXPECT_NEAR(tick.surface_velocity, speed / std::hypot(1.0, slope), 0.01 * speed);
  // What would carry a hand that sticks, or a fixture, aside is no motion that depth shows.
  EXPECT_LT((tick.surface_motion - tick.surface_velocity * tick.normal).norm(), 0.02 * speed);
}

TEST(Sight, LeavesNothingOfAnOldForceOnAHandThatHasLeft) {
  // A slow camera: what its last frame corrected is spread over 85 ms, and the hand is gone in 20.
  const Overhead camera;
  std::mt19937 random(8);
  constexpr double slow = 0.1;  // [s]
  Sight sight = seated({0, 0, 0.03});
  const auto hand = [](double t) { return Vec3(0.0002, 0, -0.008 + 0.5 * std::max(t - 1.0, 0.0)); };
  for (int k = 0; k < 12; ++k) {
    const double height = k < 10 ? 0.0 : -0.001;
    const DepthImage image = camera.shoot([&](double, double) { return height; }, 0.0, random);
    sight.observe({image, k * slow});
    for (int i = 0; i < 100; ++i) {
      const double t = k * slow + 1e-3 * i;
      const Tick tick = sight.tick(hand(t), t);
      if (k == 9) {
        ASSERT_NEAR(tick.force.z(), 4.8, 0.05) << t;
      }
      if (t > 1.0 && hand(t).z() > 0.003) {
        ASSERT_EQ(tick.force.norm(), 0.0) << t;
      }
    }
  }
}

TEST(Sight, PullsNoHandThatLeavesASurfaceThatJustRose) {
  // Before a slow camera the surface rises by 12 mm. The force turns to that over 85 ms; the hand
  // is out of it in 30.
  const Overhead camera;
  std::mt19937 random(9);
  constexpr double slow = 0.1;  // [s]
  Sight sight = seated({0, 0, 0.03});
  const auto hand = [](double t) { return Vec3(0.0002, 0, -0.001 + 0.6 * std::max(t - 1.0, 0.0)); };
  std::vector<DepthImage> images;  // as long as the frames are in use
  images.reserve(12);
  for (int k = 0; k < 12; ++k) {
    const double height = k < 10 ? 0.0 : 0.012;
    images.push_back(camera.shoot([&](double, double) { return height; }, 0.0, random));
    sight.observe({images.back(), k * slow});
    for (int i = 0; i < 100; ++i) {
      const double t = k * slow + 1e-3 * i;
      const Tick tick = sight.tick(hand(t), t);
      if (k == 9) {
        ASSERT_NEAR(tick.force.z(), 0.6, 0.05) << t;
      }
      ASSERT_GE(tick.force.z(), 0.0) << t;
    }
  }
}

// By a camera 0.75 m above the plane z = 0.
// @param f      [px] focal length
// @param depth  [m] along the axis, of a viewing ray; 0: not measured
template <class Depth>
DepthImage from_above(double f, const Depth& depth) {
  const Intrinsics k{.width = 80, .height = 60, .fx = f, .fy = f, .cx = 39.5, .cy = 29.5};
  const auto rays = std::make_shared<ViewingRays>(k);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  pose.translation() = Vec3(0, 0, 0.75);
  std::vector<std::uint16_t> readings;
  for (int v = 0; v < k.height; ++v)
    for (int u = 0; u < k.width; ++u)
      readings.push_back(static_cast<std::uint16_t>(depth(rays->ray(u, v)) * 1e4));
  return DepthImage(rays, std::move(readings), 1e4, pose);
}

TEST(Sight, StaysOnASurfaceOfWhichManyPixelsAreNotMeasured) {
  // As a screen before a Kinect: pixels of 2 mm and holes of 14 mm, elsewhere in each frame. The
  // points let a proxy through that was in front of what was fitted to them.
  constexpr int seeds = 6;
  constexpr int frames = 90;
  int behind = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    std::normal_distribution<double> noise(0.0, 2e-3);
    std::uniform_real_distribution<double> place(-0.04, 0.04);
    Sight sight = seated({0, 0, 0.05});
    std::vector<DepthImage> images;  // as long as the frames are in use
    images.reserve(frames);
    for (int frame = 0; frame < frames; ++frame) {
      std::array<Vec2, 24> holes;
      for (Vec2& hole : holes) hole = Vec2(place(random), place(random));
      images.push_back(from_above(375.0, [&](const Vec2& ray) {
        const bool is_hole = std::any_of(holes.begin(), holes.end(), [&](const Vec2& hole) {
          return (0.75 * ray - hole).norm() < 7e-3;
        });
        return is_hole ? 0.0 : 0.75 + noise(random);
      }));
      const Tick tick = live_through(sight, images.back(), frame * interval, [](double t) {
        return Vec3(0, 0, std::max(0.05 - 0.1 * t, -0.012));
      });
      behind += tick.proxy.z() < 0.0 ? 1 : 0;
    }
  }
  EXPECT_LE(behind, 10) << "of " << seeds * frames << " frames; 22 where the points alone decide";
}

TEST(Sight, RestsOnABarAFewCoarsePixelsWide) {
  // 40 mm of bar before pixels 12.5 mm wide: no quadric describes so few points with two edges.
  const DepthImage image = from_above(
      60.0, [](const Vec2& ray) { return std::abs(ray.x()) * 0.75 <= 0.02 ? 0.75 : 0.85; });
  Sight sight = seated({0.004, 0.0, 0.05});
  Tick tick;
  for (int frame = 0; frame < 60; ++frame) {
    const auto press = [](double t) { return Vec3(0.004, 0, std::max(0.05 - 0.1 * t, -0.01)); };
    tick = live_through(sight, image, frame * interval, press);
  }
  EXPECT_NEAR(tick.proxy.z(), r_c, 0.4e-3);
  EXPECT_NEAR(tick.force.z(), 6.0, 0.3);
}

TEST(Sight, RestsOnACanNarrowerThanItsDiscs) {
  // A can of 54 mm before pixels 12.5 mm wide: each disc also shows the table, 40 mm lower, and the
  // fit through both falls far below the table beside it, which is no occluder for that.
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 3e-3);
  const auto depth = [&](const Vec2& ray) {
    return (0.75 * ray.norm() <= 0.027 ? 0.75 : 0.79) + noise(random);
  };
  Sight sight = seated({0, 0, 0.05});
  std::vector<DepthImage> images;  // as long as the frames are in use
  images.reserve(60);
  double mean = 0.0;  // [m] over the last second
  for (int frame = 0; frame < 60; ++frame) {
    images.push_back(from_above(60.0, depth));
    const Tick tick = live_through(sight, images.back(), frame * interval, [](double t) {
      return Vec3(0, 0, std::max(0.05 - 0.1 * t, -0.01));
    });
    if (frame >= 30) mean += tick.proxy.z() / 30.0;
  }
  EXPECT_NEAR(mean, r_c, 3e-3);
}

TEST(Sight, FeelsASmallBoxFromItsFirstFramesOn) {
  // A box of 50 x 60 mm, 1.36 m before a slow camera that looks down at 33 degrees from the
  // vertical. Wide discs see its side and the table, 30 mm lower; the noise is still unknown.
  const Intrinsics k{.width = 160, .height = 120, .fx = 422.0, .fy = 422.0, .cx = 79.5, .cy = 59.5};
  const auto rays = std::make_shared<ViewingRays>(k);
  const Vec3 axis = Vec3(0.545, 0.0, -0.839).normalized();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear().col(2) = axis;
  pose.linear().col(0) = Vec3::UnitY();
  pose.linear().col(1) = axis.cross(Vec3::UnitY());
  pose.translation() = -1.36 * axis;
  const Eigen::AlignedBox3d box(Vec3(-0.025, -0.03, -0.03), Vec3(0.025, 0.03, 0.0));
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 3e-3);
  const auto shoot = [&] {
    std::vector<std::uint16_t> depth;
    for (int v = 0; v < k.height; ++v) {
      for (int u = 0; u < k.width; ++u) {
        const Vec3 ray = pose.linear() * Vec3(rays->ray(u, v).x(), rays->ray(u, v).y(), 1.0);
        const Vec3& eye = pose.translation();
        double z = (-0.03 - eye.z()) / ray.z();  // the table
        const Eigen::Array3d a = (box.min() - eye).array() / ray.array();
        const Eigen::Array3d b = (box.max() - eye).array() / ray.array();
        const double enters = a.min(b).maxCoeff();
        if (enters <= a.max(b).minCoeff()) z = enters;
        depth.push_back(static_cast<std::uint16_t>((z + noise(random)) * 1e4 + 0.5));
      }
    }
    return DepthImage(rays, std::move(depth), 1e4, pose);
  };
  for (int run = 0; run < 10; ++run) {
    Sight sight = seated({0.0, 0.0, 0.06});
    constexpr double slow = 1.0 / 8.0;  // [s]
    std::vector<DepthImage> images;     // as long as the frames are in use
    images.reserve(12);
    for (int frame = 0; frame < 12; ++frame) {
      images.push_back(shoot());
      sight.observe({images.back(), frame * slow});
      for (int i = 0; i < 125; ++i) {
        const double t = frame * slow + i * 1e-3;
        const Tick tick = sight.tick({0, 0, std::max(0.06 - 0.4 * t, -0.007)}, t);
        if (t > 0.4) {
          ASSERT_GT(tick.proxy.z(), 0.0) << run << " at " << t;
          ASSERT_GT(tick.force.z(), 2.0) << run << " at " << t;
        }
      }
    }
  }
}

// A stereo camera's noise is the same over its window. With much of it the height comes from a disc
// as wide as the dome, of two seconds.
TEST(Sight, IsLiftedByADomeThatSlidesInUnderAHandAtRest) {
  constexpr double cap = 12e-3;                                     // [m] high
  constexpr double base = 35e-3;                                    // [m] its radius
  constexpr double window = 12e-3;                                  // [m]
  constexpr double ball = (base * base + cap * cap) / (2.0 * cap);  // [m] of which it is a part
  constexpr int resting = 60;                                       // [frames]
  constexpr int arriving = 10;
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 3e-3);
  const Overhead camera;
  Sight sight = seated({0, 0, 0.02});
  std::vector<std::unique_ptr<DepthImage>> images;
  double z = 0.0;
  for (int i = 0; i < resting + arriving + 15; ++i) {
    const double middle = 0.1 * std::max(0.0, 1.0 - std::max(i - resting, 0) / double{arriving});
    std::array<std::array<double, 40>, 40> blotches;
    for (auto& row : blotches)
      for (double& each : row) each = noise(random);
    const auto height = [&](double x, double y) {
      const auto cell = [](double at) {
        return static_cast<std::size_t>(std::clamp(at / window + 20.0, 0.0, 39.0));
      };
      const double away = std::hypot(x - middle, y);
      const double dome = away < base ? std::sqrt(ball * ball - away * away) - (ball - cap) : 0.0;
      return dome + blotches[cell(x)][cell(y)];
    };
    images.push_back(std::make_unique<DepthImage>(camera.shoot(height, 0.0, random)));
    const HipPath rests = [](double) { return Vec3(0, 0, -6e-3); };
    z = live_through(sight, *images.back(), i * interval, rests).proxy.z();
    EXPECT_LT(z, cap + 2.0 * r_c);
  }
  EXPECT_NEAR(z, cap + r_c, 2e-3);
}

// A hand slides along the floor up to a wall, both seen at 45 degrees by a camera whose noise is
// the same over its window, and rests in the corner.
TEST(Sight, RestsStillInACornerThatItSlidInto) {
  constexpr double window = 6e-3;  // [m]
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 3e-3);
  const Overhead camera;
  Sight sight = seated({-0.06, 0, 0.15});
  std::vector<DepthImage> images;  // as long as the frames are in use
  images.reserve(120);
  Eigen::AlignedBox3d places;
  for (int i = 0; i < 120; ++i) {
    std::array<std::array<double, 60>, 60> blotches;
    for (auto& row : blotches)
      for (double& each : row) each = noise(random);
    const auto cell = [](double at) {
      return static_cast<std::size_t>(std::clamp(at / window + 30.0, 0.0, 59.0));
    };
    const auto height = [&](double x, double y) {
      return std::abs(x) + blotches[cell(x)][cell(y)];
    };
    images.push_back(camera.shoot(height, 0.0, random));
    const Tick tick = live_through(sight, images.back(), i * interval, [](double t) {
      const double x = -std::max(0.06 - 0.05 * std::max(t - 0.3, 0.0), 0.0);
      return Vec3(x, 0, -x + std::max(0.03 - 0.1 * t, -8e-3));
    });
    if (i >= 80) places.extend(tick.proxy);
  }
  EXPECT_LT(places.sizes().maxCoeff(), 2e-3);
  EXPECT_NEAR(places.center().z(), r_c * std::sqrt(2.0), 1e-3);
}

TEST(Sight, StopsAtARiserThatTheCameraDoesNotSee) {
  constexpr double rise = 26e-3;      // [m]
  constexpr double slow = 1.0 / 6.0;  // [s] between frames, in which the hand slides 10 mm
  constexpr double speed = 0.06;      // [m/s]
  std::mt19937 random(1);
  const Overhead camera;
  Sight sight = seated({-0.05, 0, 0.02});
  const DepthImage stairs =
      camera.shoot([](double x, double) { return x < 0.0 ? 0.0 : rise; }, 0.0, random);
  Tick tick;
  for (int i = 0; i < 8; ++i) {
    sight.observe({stairs, i * slow});
    for (double t = i * slow; t < (i + 1) * slow; t += 1e-3) {
      tick = sight.tick({-0.05 + speed * t, 0, t < slow ? 0.02 : -5e-3}, t);
      EXPECT_LT(tick.proxy.x(), 0.0);
    }
  }
  EXPECT_LT(tick.force.x(), -1.0);
}

TEST(Sight, StaysOnASurfaceThatAnArmCoversWhileTheHandSlides) {
  std::mt19937 random(1);
  const Overhead camera;
  Sight sight = seated({-0.05, 0, 0.02});
  std::vector<DepthImage> images;  // as long as the frames are in use
  images.reserve(30);
  const auto stroke = [](double t) { return Vec3(-0.05 + 0.15 * t, 0, t < 0.1 ? 0.02 : -8e-3); };
  for (int i = 0; i < 21; ++i) {
    const double arm = 0.05 - 0.05 * i * interval;  // [m] its edge, which comes from +x
    images.push_back(camera.shoot(
        [&](double x, double) { return x > arm && x < arm + 0.1 ? 0.15 : 0.0; }, 0.5e-3, random));
    const Tick tick = live_through(sight, images.back(), i * interval, stroke);
    if (i > 4) {
      EXPECT_NEAR(tick.proxy.z(), r_c, 1e-3) << "frame " << i << ", arm at " << arm;
    }
  }
}

TEST(Sight, TakesNoPlaceForFreeThatSomethingNearTheCameraHides) {
  std::mt19937 random(1);
  const Overhead camera;
  Sight sight = seated({0, 0, 0.02});
  std::vector<DepthImage> images;  // as long as the frames are in use
  images.reserve(30);
  // Beside what hides the hand the table ends: all that is measured there lies deeper than it.
  for (int i = 0; i < 20; ++i) {
    const auto height = [&](double x, double) {
      return i < 12 ? (x < 0.03 ? 0.0 : -0.1) : x < 0.03 ? 0.4 : -0.1;
    };
    images.push_back(camera.shoot(height, 0.5e-3, random));
    const Tick tick = live_through(sight, images.back(), i * interval,
                                   [&](double) { return Vec3(0, 0, i < 3 ? 0.02 : -4e-3); });
    EXPECT_EQ(tick.flags & free_space_released, 0U) << i;
    if (i >= 12) {
      EXPECT_NEAR(tick.proxy.z(), r_c, 1e-3) << i;
    }
  }
}

// A hand 5 mm deep in a surface that both move up with, at 0.08 m/s.
class Ride {
 public:
  // [N] the rendered force of the next tick.
  double tick(double known, bool returned = false, const Vec3& force = Vec3(0, 0, 3.0)) {
    return force_in(known, returned, force).norm();
  }
  Vec3 force_in(double known, bool returned, const Vec3& force) {
    t_ += 1e-3;
    return renderer_.render({.hip = Vec3(0, 0, 0.08 * t_),
                             .t = t_,
                             .force = force,
                             .normal = Vec3(0, 0, 1),
                             .velocity = Vec3(0, 0, 0.08),
                             .blend = 0.03,
                             .known = known,
                             .returned = returned,
                             .return_speed = 0.01,
                             .r_c = r_c},
                            {});
  }

 private:
  ForceRenderer renderer_;
  double t_ = 0.0;
};

TEST(ForceRenderer, LetsASurfaceComeBackToAHandThatRidesOnIt) {
  Ride ride;
  EXPECT_NEAR(ride.tick(1.0), 3.0, 1e-9);
  EXPECT_NEAR(ride.tick(0.5), 1.5, 0.01);
  for (int i = 0; i < 100; ++i) ride.tick(1.0);
  EXPECT_NEAR(ride.tick(1.0), 1.5 + 0.6, 0.05) << "600 N/m at 10 mm/s for 0.1 s";
}

TEST(ForceRenderer, KeepsWhatWasFeltWhenTheProxyIsPutBackInFront) {
  Ride ride;
  ride.tick(1.0);
  EXPECT_NEAR(ride.tick(1.0, true, Vec3(0, 0, 5.0)), 3.0, 0.1);
  EXPECT_LT(ride.tick(1.0, false, Vec3(0, 0, 5.0)), 3.2);
}

TEST(ForceRenderer, TurnsTheForceWhereTheProxyIsPutBackAsideWithoutAStep) {
  Ride ride;
  ride.tick(1.0);
  const Vec3 aside(0, 3.0, 0);
  Vec3 last = ride.force_in(1.0, true, aside);
  EXPECT_LT((last - Vec3(0, 0, 3.0)).norm(), 0.1);
  for (int i = 0; i < 29; ++i) {
    const Vec3 now = ride.force_in(1.0, false, aside);
    EXPECT_LT((now - last).norm(), 0.2) << i;
    last = now;
  }
  EXPECT_LT(last.z(), 0.05);
  EXPECT_NEAR(last.y(), 600.0 * 0.01 * 0.03, 0.03) << "another direction is new";
}

TEST(ForceRenderer, SpreadsWhatJumpsBetweenFramesButEndsAForceInATick) {
  ForceRenderer renderer;
  double t = 0.0;
  const auto tick = [&](const Vec3& force) {
    t += 1e-3;
    return renderer.render({.hip = Vec3::Zero(),
                            .t = t,
                            .force = force,
                            .normal = Vec3(0, 0, 1),
                            .velocity = Vec3::Zero(),
                            .blend = 0.03,
                            .known = 1.0,
                            .returned = false,
                            .return_speed = 0.01,
                            .r_c = r_c},
                           {});
  };
  Vec3 last = tick(Vec3(0, 0, 3));
  last = tick(Vec3(0, 0, 3));
  for (int i = 0; i < 40; ++i) {
    const Vec3 now = tick(Vec3(2, 0, 5));
    EXPECT_LT((now - last).norm(), 0.16) << i;
    last = now;
  }
  EXPECT_LT((last - Vec3(2, 0, 5)).norm(), 1e-9);
  renderer.release();
  EXPECT_EQ(tick(Vec3::Zero()), Vec3(0, 0, 0));
}

TEST(Sight, ComesBackSlowlyWhateverTheFirstFramesCorrect) {
  // Two seconds without a frame; then the plane is 4 mm higher, and the frames are noisy.
  const Overhead camera;
  std::mt19937 random(7);
  constexpr double stiffness = 600.0;    // [N/m]
  constexpr double return_speed = 0.01;  // [m/s]
  Sight sight = seated({0, 0, 0.03});
  const auto press = [](double) { return Vec3(0.0002, 0, -0.008); };
  Tick tick;
  double t = 0.0;
  std::vector<DepthImage> images;  // as long as the frames are in use
  images.reserve(100);
  for (; t < 0.5; t += interval) {
    images.push_back(camera.shoot([](double, double) { return 0.0; }, 1e-3, random));
    tick = live_through(sight, images.back(), t, press);
  }
  const double resumes = t + 2.0;
  for (; t < resumes; t += 1e-3) tick = sight.tick(press(t), t);
  ASSERT_EQ(tick.force.norm(), 0.0);
  for (; t < resumes + 2.0; t += interval) {
    images.push_back(camera.shoot([](double, double) { return 0.004; }, 1e-3, random));
    sight.observe({images.back(), t});
    for (int i = 0; i < 33; ++i) {
      const double now = t + 1e-3 * i;
      tick = sight.tick(press(now), now);
      ASSERT_LE(tick.force.norm(), stiffness * return_speed * (now - resumes + 1e-3)) << now;
    }
  }
  EXPECT_NEAR(tick.force.norm(), stiffness * 0.012, 0.2);
}

TEST(Sight, KeepsItsNormalWhileTheSurfaceRests) {
  const Overhead camera;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    std::mt19937 random(seed);
    Sight sight = seated({0, 0, 0.03});
    std::optional<Vec3> last;
    for (int k = 0; k < 150; ++k) {
      const DepthImage image = camera.shoot([](double, double) { return 0.0; }, 3e-3, random);
      const Tick tick =
          live_through(sight, image, k * interval, [](double) { return Vec3(0.0002, 0, -0.01); });
      if (last && k > 40) {
        EXPECT_GT(tick.normal.dot(*last), std::cos(0.02)) << "seed " << seed << " frame " << k;
      }
      last = tick.normal;
    }
  }
}

TEST(Sight, RendersASineOfTwentyMillimetresWithoutStepsAndWithoutLag) {
  const Overhead camera;
  std::mt19937 random(6);
  Sight sight = seated({0, 0, 0.04});
  const auto height = [](double t) { return 0.01 * std::sin(2.0 * std::numbers::pi * t); };
  double squares = 0.0;
  double largest_step = 0.0;
  double last = 0.0;
  int ticks = 0;
  int frames = 0;
  for (int i = 0; i < 2000; ++i) {
    const double t = i * 1e-3;
    // Frames outlive their use here because the sight reads them until the next.
    static std::optional<DepthImage> image;
    if (t >= frames * interval - 1e-9) {
      const double stamp = frames++ * interval;
      image.emplace(camera.shoot([&](double, double) { return height(stamp); }, 0.0, random));
      sight.observe({*image, stamp});
    }
    const double force = sight.tick({0, 0, -0.0125}, t).force.z();
    if (i >= 1000) {
      squares += std::pow(force - 600.0 * (height(t) + 0.0125), 2);
      largest_step = std::max(largest_step, std::abs(force - last));
      ++ticks;
    }
    last = force;
  }
  EXPECT_LT(std::sqrt(squares / ticks), 0.1);
  EXPECT_LT(largest_step, 0.06);
}

// The force at the end of a second of contact with a plane, both moving along z at those speeds.
double pressed_force(double damping, double hand_speed, double surface_speed, double sigma) {
  Parameters parameters;
  parameters.coupling.damping = damping;
  Sight sight(parameters);
  sight.seat(Vec3(0, 0, 0.03));
  std::mt19937 random(3);
  constexpr int frames = 30;
  const double end = frames * interval;
  Tick tick;
  for (int k = 0; k < frames; ++k) {
    const double stamp = k * interval;
    const PointCloud cloud =
        seen_from_above(flat_grid(surface_speed * (stamp - end), 1.5e-3, 40), sigma, random);
    tick = live_through(sight, cloud, stamp,
                        [&](double t) { return Vec3(0, 0, -0.01 + hand_speed * (t - end)); });
  }
  return tick.force.z();
}

TEST(Sight, DampsTheHandsVelocityRelativeToTheSurface) {
  constexpr double damping = 2.0;
  const auto added = [](double hand, double surface) {
    return pressed_force(damping, hand, surface, 0.0) - pressed_force(0.0, hand, surface, 0.0);
  };
  EXPECT_NEAR(added(-0.02, 0.0), damping * 0.02, 1e-4) << "a hand that presses in";
  EXPECT_NEAR(added(0.02, 0.0), -damping * 0.02, 1e-4) << "a hand that yields";
  EXPECT_NEAR(added(0.02, 0.02), 0.0, 2e-3) << "a hand that goes along";
  // Corrections of the estimate under noise are no velocity.
  EXPECT_EQ(pressed_force(damping, 0.0, 0.0, 1e-3), pressed_force(0.0, 0.0, 0.0, 1e-3));
}

TEST(Sight, FollowsASurfaceThatTurns) {
  std::mt19937 random(8);
  Sight sight = seated({0, 0, 0.03});
  for (int k = 0; k < 40; ++k) {
    const double slope = 0.02 * std::max(k - 10, 0);
    const PointCloud plane = seen_from_above(
        grid(1.5e-3, 40, [&](double x, double) { return slope * x; }), 0.2e-3, random);
    const Tick tick =
        live_through(sight, plane, k * interval, [](double) { return Vec3(0, 0, -0.003); });
    const Vec3 normal = Vec3(-slope, 0, 1).normalized();
    if (k < 3) continue;
    EXPECT_GT(tick.normal.dot(normal), std::cos(0.06)) << "frame " << k;
    EXPECT_NEAR(tick.proxy.dot(normal), r_c, 0.7e-3) << "frame " << k;
  }
}

TEST(Sight, GivesTheSameTicksBitForBitOnEveryRun) {
  const Overhead camera;
  const auto run = [&] {
    std::mt19937 random(9);
    Sight sight = seated({0, 0, 0.02});
    std::vector<double> out;
    for (int k = 0; k < 12; ++k) {
      const DepthImage image =
          camera.shoot([](double x, double) { return 1e-3 * std::sin(300 * x); }, 0.5e-3, random);
      const Tick tick = live_through(sight, image, k * interval, [](double t) {
        return Vec3(0.05 * t, 0.02 * t, 0.01 - 0.05 * t);
      });
      for (int i = 0; i < 3; ++i) out.push_back(tick.force[i]);
      for (int i = 0; i < 3; ++i) out.push_back(tick.proxy[i]);
    }
    return out;
  };
  EXPECT_EQ(run(), run());
}

// The forces on a hand in a plane that moves by 5 mm at 1 Hz, in noise of 1 mm, of whose points one
// in seven flies.
double sum_of_forces(const Parameters& parameters) {
  Sight sight(parameters);
  sight.seat({0, 0, 0.03});
  std::mt19937 random(11);
  std::normal_distribution<double> noise(0.0, 1e-3);
  std::uniform_int_distribution<int> one_in_seven(0, 6);
  double sum = 0.0;
  for (int frame = 0; frame < 30; ++frame) {
    const double z = 5e-3 * std::sin(2.0 * std::numbers::pi * frame * interval);
    const PointCloud plane(test::grid(3e-3, 40,
                                      [&](double, double) {
                                        const bool flies = one_in_seven(random) == 0;
                                        return z + noise(random) + (flies ? 0.08 : 0.0);
                                      }),
                           Vec3(0, 0, 1));
    sight.observe({plane, frame * interval});
    for (int i = 0; i < 33; ++i) {
      const double t = frame * interval + 1e-3 * i;
      sum += sight.tick({0, 0, std::max(0.03 - 0.2 * t, -0.01)}, t).force.norm();
    }
  }
  return sum;
}

TEST(Sight, HeedsEachParameterOfItsEstimator) {
  const double usual = sum_of_forces({});
  ASSERT_GT(usual, 1000.0);
  for (const auto& [name, value] : {std::pair{"usual_noise", 0.05},
                                    {"noise_growth", 1.0},
                                    {"confidence", 1.0},
                                    {"least_share", 0.9},
                                    {"widest_fit", 2.2},
                                    {"averaged_frames", 2.0},
                                    {"rest_odds", 0.0},
                                    {"motion_memory", 0.4},
                                    {"curvature_sd", 1e3},
                                    {"blend", 0.1}}) {
    Parameters parameters;
    set_parameter(parameters, name, value);
    EXPECT_NE(sum_of_forces(parameters), usual) << name;
  }
}

TEST(Sight, TakesACameraOfWhichNothingIsKnownForAStereoCamera) {
  Parameters stereo;
  set_parameter(stereo, "usual_noise", 5e-3);
  set_parameter(stereo, "noise_growth", 2);
  EXPECT_EQ(sum_of_forces(stereo), sum_of_forces({})) << "bit for bit";
}

TEST(Sight, BearsEmptyFramesAndStampsThatStandStill) {
  const PointCloud nothing(std::vector<Vec3>{});
  std::mt19937 random(1);
  const PointCloud plane = seen_from_above(flat_grid(), 0.0, random);
  Sight sight = seated({0, 0, 0.02});
  const HipPath press = [](double) { return Vec3(0, 0, -0.01); };
  live_through(sight, plane, 0.0, press);
  live_through(sight, plane, 0.0, press);
  const Tick hidden = live_through(sight, nothing, 0.033, press);
  EXPECT_TRUE(hidden.flags & surface_hidden);
  EXPECT_NEAR(hidden.proxy.z(), r_c, 1e-4);
  const Tick again = live_through(sight, plane, 0.066, press);
  EXPECT_FALSE(again.flags & surface_hidden);
  EXPECT_NEAR(again.proxy.z(), r_c, 1e-4);
}

}  // namespace test_sight
}  // namespace palpate
