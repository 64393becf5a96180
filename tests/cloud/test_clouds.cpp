// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <tuple>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/paper/paper.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace test_clouds {

using Point = std::tuple<float, float, float>;

// What a gather finds, in an order that does not depend on how it searched.
std::vector<Point> found(const Cloud& cloud, const std::variant<Ball, Beam>& where) {
  Patch patch;
  if (const Ball* ball = std::get_if<Ball>(&where)) {
    gather(cloud, *ball, patch);
  } else {
    gather(cloud, std::get<Beam>(where), Patch::capacity, patch);
  }
  std::vector<Point> points;
  for (std::size_t i = 0; i < patch.size(); ++i)
    points.emplace_back(patch.x()[i], patch.y()[i], patch.z()[i]);
  std::sort(points.begin(), points.end());
  return points;
}

// The two searches round differently (by nanometres), so sets are compared point by point.
::testing::AssertionResult same_points(const std::vector<Point>& a, const std::vector<Point>& b) {
  if (a.size() != b.size())
    return ::testing::AssertionFailure() << a.size() << " points against " << b.size();
  const auto near = [](const Point& p, const Point& q) {
    constexpr float rounding = 6e-8F;  // of a float some 0.3 m away
    return std::abs(std::get<0>(p) - std::get<0>(q)) <= rounding &&
           std::abs(std::get<1>(p) - std::get<1>(q)) <= rounding &&
           std::abs(std::get<2>(p) - std::get<2>(q)) <= rounding;
  };
  std::vector<bool> used(b.size(), false);
  for (const Point& p : a) {
    bool matched = false;
    for (std::size_t j = 0; j < b.size() && !matched; ++j) {
      if (used[j] || !near(p, b[j])) continue;
      used[j] = true;
      matched = true;
    }
    if (!matched)
      return ::testing::AssertionFailure() << "no partner for (" << std::get<0>(p) << ", "
                                           << std::get<1>(p) << ", " << std::get<2>(p) << ")";
  }
  return ::testing::AssertionSuccess();
}

struct RandomScene {
  std::mt19937 random;
  explicit RandomScene(unsigned seed) : random(seed) {}

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }

  Eigen::Isometry3d pose() {
    const Eigen::Quaterniond q(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    return Eigen::Translation3d(uniform(-2, 2), uniform(-2, 2), uniform(-2, 2)) * q.normalized();
  }

  Intrinsics intrinsics(bool distorted) {
    Intrinsics k;
    k.width = static_cast<int>(uniform(1, 120));
    k.height = static_cast<int>(uniform(1, 90));
    k.fx = uniform(40, 140);
    k.fy = uniform(40, 140);
    k.cx = uniform(-10, 130);
    k.cy = uniform(-10, 100);
    if (distorted)
      k.distortion = {uniform(-0.2, 0.2), uniform(-0.05, 0.05), 1e-3, -1e-3, 0.01, 0, 0, 0};
    return k;
  }

  // Waves with holes, saturated pixels, steps and noise, 0.05 to 1.5 m away.
  DepthImage image(bool distorted) {
    const Intrinsics k = intrinsics(distorted);
    std::vector<std::uint16_t> depth;
    const double base = uniform(0.05, 1.5);
    for (int i = 0; i < k.width * k.height; ++i) {
      const double z = base * (1.0 + 0.1 * std::sin(i * 0.05)) + (i % 37 < 11 ? 0.03 : 0.0) +
                       uniform(-0.002, 0.002);
      const double lot = uniform(0, 1);
      depth.push_back(lot < 0.1    ? std::uint16_t{0}
                      : lot < 0.12 ? std::uint16_t{65535}
                                   : static_cast<std::uint16_t>(z * 5000.0));
    }
    return {std::make_shared<ViewingRays>(k), depth, 5000.0, pose()};
  }

  // Balls on measured points, at the image's border, around and behind the camera, and far off.
  Ball ball(const DepthImage& image) {
    const Intrinsics& k = image.intrinsics();
    const auto p = image.deproject(static_cast<int>(uniform(0, k.width)),
                                   static_cast<int>(uniform(0, k.height)));
    const double radius = uniform(0.001, 0.05);
    const double lot = uniform(0, 1);
    if (p && lot < 0.7)
      return {*p + Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)) * radius, radius};
    if (lot < 0.9)
      return {
          image.world_from_camera() * (0.1 * Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1))),
          radius};
    return {Vec3(uniform(-5, 5), uniform(-5, 5), uniform(-5, 5)), radius};
  }
};

class FastSearch : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Lens, FastSearch, ::testing::Values(false, true));

TEST_P(FastSearch, FindsExactlyWhatBruteForceFindsInADepthImage) {
  const int scenes = test::rounds(60);
  int total = 0;
  for (int seed = 0; seed < scenes; ++seed) {
    RandomScene scene(seed);
    const DepthImage image = scene.image(GetParam());
    const BruteForceCloud oracle(image.points());
    for (int i = 0; i < 12; ++i) {
      const Ball ball = scene.ball(image);
      const auto expected = found(oracle, ball);
      EXPECT_TRUE(same_points(found(image, ball), expected)) << "seed " << seed << ", ball " << i;
      total += static_cast<int>(expected.size());
    }
  }
  EXPECT_GT(total, 50 * scenes) << "the property must not hold because nothing was found";
}

TEST(PointCloud, FindsExactlyWhatBruteForceFinds) {
  const int scenes = test::rounds(60);
  int total = 0;
  for (int seed = 0; seed < scenes; ++seed) {
    RandomScene scene(seed);
    std::vector<Vec3> points;
    const double size = std::exp(scene.uniform(-4, 1));
    for (int i = 0; i < 2000; ++i)
      points.emplace_back(size * Vec3(scene.uniform(-1, 1), scene.uniform(-1, 1),
                                      0.1 * std::round(scene.uniform(-3, 3))));
    const PointCloud cloud(points);
    const BruteForceCloud oracle(points);
    for (int i = 0; i < 20; ++i) {
      const double radius = scene.uniform(0.001, 0.2);
      const Ball ball{
          points[static_cast<std::size_t>(scene.uniform(0, 1999))] +
              radius * Vec3(scene.uniform(-1, 1), scene.uniform(-1, 1), scene.uniform(-1, 1)),
          radius};
      const auto expected = found(oracle, ball);
      EXPECT_EQ(found(cloud, ball), expected) << "seed " << seed << ", ball " << i;
      total += static_cast<int>(expected.size());
    }
  }
  EXPECT_GT(total, 150 * scenes);
}

TEST_P(FastSearch, FindsInABeamWhatBruteForceFindsInADepthImage) {
  const int scenes = test::rounds(60);
  int total = 0;
  for (int seed = 0; seed < scenes; ++seed) {
    RandomScene scene(seed);
    const DepthImage image = scene.image(GetParam());
    const BruteForceCloud oracle(image.points(), Vec3(image.world_from_camera().translation()));
    for (int i = 0; i < 12; ++i) {
      const Ball ball = scene.ball(image);
      const Beam beam{ball.centre, ball.radius, scene.uniform(0.01, 0.3), Vec3::UnitX()};
      // A place nearer than the beam is wide is seen along no line.
      if ((ball.centre - image.world_from_camera().translation()).norm() < 1.5 * ball.radius)
        continue;
      const auto expected = found(oracle, beam);
      EXPECT_TRUE(same_points(found(image, beam), expected)) << "seed " << seed << ", beam " << i;
      total += static_cast<int>(expected.size());
    }
  }
  EXPECT_GT(total, 80 * scenes);
}

TEST(PointCloud, FindsInABeamWhatBruteForceFinds) {
  const int scenes = test::rounds(60);
  int total = 0;
  for (int seed = 0; seed < scenes; ++seed) {
    RandomScene scene(seed);
    std::vector<Vec3> points;
    const double size = std::exp(scene.uniform(-3, 0));
    for (int i = 0; i < 2000; ++i)
      points.emplace_back(size * Vec3(scene.uniform(-1, 1), scene.uniform(-1, 1),
                                      0.1 * std::round(scene.uniform(-3, 3))));
    std::optional<Vec3> viewpoint;
    if (seed % 3 != 0)
      viewpoint = 2.0 * Vec3(scene.uniform(-1, 1), scene.uniform(-1, 1), scene.uniform(-1, 1));
    const PointCloud cloud(points, viewpoint);
    const BruteForceCloud oracle(points, viewpoint);
    for (int i = 0; i < 20; ++i) {
      const Vec3 axis = Vec3(scene.uniform(-1, 1), scene.uniform(-1, 1), scene.uniform(-1, 1));
      const Beam beam{points[static_cast<std::size_t>(scene.uniform(0, 1999))],
                      scene.uniform(0.001, 0.2), scene.uniform(0.01, 0.5), axis.normalized()};
      const auto expected = found(oracle, beam);
      EXPECT_EQ(found(cloud, beam), expected) << "seed " << seed << ", beam " << i;
      total += static_cast<int>(expected.size());
    }
  }
  EXPECT_GT(total, 150 * scenes);
}

TEST(PointCloud, LeavesOutAndCountsPointsThatAreNotFinite) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const std::array points = {Vec3(0, 0, 0), Vec3(nan, 0, 0),
                             Vec3(0, std::numeric_limits<double>::infinity(), 0), Vec3(0.1, 0, 0)};
  const PointCloud cloud(points);
  EXPECT_EQ(cloud.size(), 2U);
  EXPECT_EQ(cloud.non_finite(), 2U);
}

TEST(PointCloud, HoldsPointsSpreadOverTheRangeOfDoubles) {
  const std::array points = {Vec3(-1e308, 0, 0), Vec3(1e308, 5, -1e300), Vec3(0.001, 0.002, 0.003)};
  const PointCloud cloud(points);
  EXPECT_EQ(found(cloud, Ball{Vec3(0, 0, 0), 0.01}).size(), 1U);
}

TEST(PointCloud, HoldsPointsThatAreNearlyAtOnePlace) {
  const double least = std::numeric_limits<double>::denorm_min();
  const std::array points = {Vec3(0, 0, 0), Vec3(least, 0, 0), Vec3(0, 3 * least, 0)};
  const PointCloud cloud(points);
  EXPECT_EQ(cloud.size(), 3U);
  EXPECT_EQ(found(cloud, Ball{Vec3(0, 0, 0), 0.01}).size(), 3U);
}

TEST(PointCloud, FindsNothingWhenItIsEmpty) {
  const PointCloud cloud(std::span<const Vec3>{});
  EXPECT_TRUE(found(cloud, Ball{Vec3(0, 0, 0), 1.0}).empty());
}

TEST(PointCloud, ThinsABallThatHoldsMoreThanAPatchAndSaysSo) {
  RandomScene scene(1);
  std::vector<Vec3> points;
  for (int i = 0; i < 100000; ++i)
    points.emplace_back(0.01 *
                        Vec3(scene.uniform(-1, 1), scene.uniform(-1, 1), scene.uniform(-1, 1)));
  Patch patch;
  gather(PointCloud(points), Ball{Vec3::Zero(), 0.02}, patch);
  EXPECT_TRUE(patch.thinned());
  EXPECT_GT(patch.size(), Patch::capacity / 3);
  EXPECT_LE(patch.size(), Patch::capacity);
  EXPECT_NEAR(static_cast<double>(patch.size()) / patch.share(), 100000.0, 100.0);
  Vec3 mean = Vec3::Zero();
  for (std::size_t i = 0; i < patch.size(); ++i)
    mean += Vec3(patch.x()[i], patch.y()[i], patch.z()[i]) / static_cast<double>(patch.size());
  EXPECT_LT(mean.norm(), 0.0005) << "thinned evenly, not cut off";
}

TEST(PointCloud, ThinsEvenlyASheetThatHoldsMoreThanABeamWants) {
  RandomScene scene(2);
  std::vector<Vec3> points;
  for (int i = 0; i < 300000; ++i)
    points.emplace_back(scene.uniform(-1, 1), scene.uniform(-1, 1), 1.0);
  const PointCloud cloud(points, Vec3::Zero());
  constexpr std::size_t wanted = 640;
  Patch patch;
  for (const double radius : {0.03, 0.05, 0.3}) {
    const Beam beam{Vec3(0.2, -0.1, 1.0), radius, 0.3, Vec3::UnitZ()};
    gather(cloud, beam, wanted, patch);
    const SightCone cone(beam, Vec3::Zero());
    const auto held =
        static_cast<double>(std::count_if(points.begin(), points.end(), [&](const Vec3& point) {
          return cone.holds(point - beam.through);
        }));
    EXPECT_EQ(patch.thinned(), held > static_cast<double>(wanted)) << radius;
    EXPECT_LE(patch.size(), wanted);
    EXPECT_GE(static_cast<double>(patch.size()), std::min(held, wanted / 3.0));
    EXPECT_NEAR(static_cast<double>(patch.size()) / patch.share(), held, 0.1 * held) << radius;
    std::array<std::size_t, 4> quarters{};
    for (std::size_t i = 0; i < patch.size(); ++i)
      ++quarters[(patch.x()[i] > 0.0F ? 1 : 0) + (patch.y()[i] > 0.0F ? 2 : 0)];
    for (const std::size_t quarter : quarters) {
      EXPECT_NEAR(static_cast<double>(quarter), static_cast<double>(patch.size()) / 4.0,
                  0.3 * static_cast<double>(patch.size()) / 4.0)
          << radius;
    }
  }
}

TEST(PointCloud, KeepsItsOrderWhenItIsMadeAgain) {
  RandomScene scene(3);
  std::vector<Vec3> points(1000, Vec3(0.5, 0.5, 0.5));
  for (int i = 0; i < 1000; ++i)
    points.emplace_back(scene.uniform(-1, 1), scene.uniform(-1, 1), scene.uniform(-1, 1));
  const PointCloud once(points);
  std::vector<Vec3> sorted;
  for (std::size_t i = 0; i < once.size(); ++i) sorted.push_back(once.point(i));
  const PointCloud twice(sorted);
  for (std::size_t i = 0; i < once.size(); ++i) ASSERT_EQ(twice.point(i), sorted[i]) << i;
}

TEST(DepthImage, ThinsAWindowThatHoldsMoreThanAPatchAndSaysSo) {
  const Intrinsics k{.width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 320, .cy = 240};
  const DepthImage image(std::make_shared<ViewingRays>(k),
                         std::vector<std::uint16_t>(640 * 480, 500), 5000.0);
  Patch patch;
  gather(image, Ball{Vec3(0, 0, 0.1), 0.05}, patch);
  EXPECT_TRUE(patch.thinned());
  EXPECT_GT(patch.size(), Patch::capacity / 4);
  int within = 0;
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) within += std::hypot(u - k.cx, v - k.cy) <= 300.0 ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(patch.size()) / patch.share(), within, 0.02 * within);
  float low = 0;
  float high = 0;
  for (std::size_t i = 0; i < patch.size(); ++i) {
    low = std::min(low, patch.x()[i]);
    high = std::max(high, patch.x()[i]);
  }
  EXPECT_NEAR(low, -0.05F, 1e-3F);
  EXPECT_NEAR(high, 0.05F, 1e-3F);
}

TEST(DepthImage, SeesNothingBehindTheCameraOrOutsideTheImage) {
  const Intrinsics k{.width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 32, .cy = 24};
  const DepthImage image(std::make_shared<ViewingRays>(k),
                         std::vector<std::uint16_t>(64 * 48, 1000), 1000.0);
  EXPECT_TRUE(found(image, Ball{Vec3(0, 0, -1), 0.5}).empty());
  EXPECT_TRUE(found(image, Ball{Vec3(10, 0, 1), 0.5}).empty());
  EXPECT_FALSE(found(image, Ball{Vec3(0, 0, 1), 0.5}).empty());
}

TEST(DepthImage, RemembersFromWhereItsPointsWereSeen) {
  RandomScene scene(5);
  const DepthImage image = scene.image(false);
  Patch patch;
  gather(image, scene.ball(image), patch);
  ASSERT_EQ(patch.view_count(), 1U);
  EXPECT_EQ(patch.view(0).viewpoint, Vec3(image.world_from_camera().translation()));
}

TEST(CloudSet, GathersFromEveryCloudUnderItsOwnView) {
  const std::vector<Vec3> left = {Vec3(-0.001, 0, 0)};
  const std::vector<Vec3> right = {Vec3(0.001, 0, 0), Vec3(0.002, 0, 0)};
  const CloudSet set({std::make_shared<PointCloud>(left, Vec3(-1, 0, 0)),
                      std::make_shared<PointCloud>(right, Vec3(1, 0, 0))});
  Patch patch;
  gather(set, Ball{Vec3::Zero(), 0.01}, patch);
  ASSERT_EQ(patch.size(), 3U);
  ASSERT_EQ(patch.view_count(), 2U);
  EXPECT_EQ(patch.view(1).begin, 1U);
  EXPECT_EQ(patch.view(0).viewpoint, Vec3(-1, 0, 0));
  EXPECT_EQ(patch.view(1).viewpoint, Vec3(1, 0, 0));
}

// A block, 40 to 79 pixels across, 0.5 m away before a wall at 0.5 m + `gap`, from straight on.
struct BlockBeforeWall {
  static constexpr int size = 120;
  static constexpr double f = 300.0;

  explicit BlockBeforeWall(double gap, int hole = 0) {
    Intrinsics k;
    k.width = k.height = size;
    k.fx = k.fy = f;
    k.cx = k.cy = 60.0;
    const auto wall = static_cast<std::uint16_t>(std::lround((0.5 + gap) * 1e4));
    std::vector<std::uint16_t> depth(static_cast<std::size_t>(size * size), wall);
    for (int v = 40; v < 80; ++v) {
      for (int u = 40; u < 80 + hole; ++u) {
        depth[static_cast<std::size_t>(v * size + u)] =
            u < 80 ? std::uint16_t{5000} : std::uint16_t{0};
      }
    }
    image = std::make_unique<DepthImage>(std::make_shared<ViewingRays>(k), depth, 1e4);
  }

  // The sides within 30 mm of the middle of the block's right edge, `depth` behind it.
  [[nodiscard]] std::vector<Vec3> sides(double depth, double radius = 0.03) const {
    const Vec3 edge = Vec3((79.0 - 60.0) / f, 0.0, 1.0) * (0.5 + depth);
    Patch patch;
    patch.start({edge, radius});
    image->gather_sides(patch.ball(), {0.01, 0.04}, Patch::capacity, patch);
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < patch.size(); ++i)
      points.emplace_back(edge + Vec3(patch.x()[i], patch.y()[i], patch.z()[i]));
    return points;
  }

  std::unique_ptr<DepthImage> image;
};

TEST(DepthImage, GivesABodySidesOnTheLinesOfSightPastItsEdge) {
  for (const int hole : {0, 5}) {  // a stereo camera sees nothing beside what is near
    const std::vector<Vec3> sides = BlockBeforeWall(0.3, hole).sides(0.0);
    double deepest = 0.0;
    for (const Vec3& p : sides) {
      EXPECT_NEAR(p.x() / p.z(), 19.0 / BlockBeforeWall::f, 1e-6);
      EXPECT_LE(std::abs(p.y() / p.z()), 20.5 / BlockBeforeWall::f);
      EXPECT_GT(p.z(), 0.5);
      deepest = std::max(deepest, p.z());
    }
    // As far as the ball goes, and as densely as pixels lie: 30 mm of depth over 36 rows.
    EXPECT_NEAR(deepest, 0.53, 2e-3);
    EXPECT_GT(sides.size(), 400U);
  }
}

TEST(DepthImage, EndsSidesAtTheirDepthOrAtWhatIsSeenPastThem) {
  for (const auto& [gap, end] : {std::pair{0.3, 0.54}, std::pair{0.025, 0.525}}) {
    double deepest = 0.0;
    for (const Vec3& p : BlockBeforeWall(gap).sides(0.02)) deepest = std::max(deepest, p.z());
    EXPECT_LT(deepest, end);
    EXPECT_GT(deepest, end - 3e-3);
  }
  EXPECT_TRUE(BlockBeforeWall(0.008).sides(0.0).empty()) << "a step lower than `jump`";
}

TEST(DepthImage, GivesNoSidesToASlopeASmoothWallAHoleInItOrTheImagesBorder) {
  Intrinsics k;
  k.width = k.height = 60;
  k.fx = k.fy = 300.0;
  k.cx = k.cy = 30.0;
  std::vector<std::uint16_t> depth;
  for (int v = 0; v < 60; ++v) {
    for (int u = 0; u < 60; ++u) {  // 60 degrees steep, with two holes
      const bool hole =
          (u - 20) * (u - 20) + (v - 20) * (v - 20) < 16 || (u == 40 && v > 30 && v < 45);
      depth.push_back(hole ? std::uint16_t{0} : static_cast<std::uint16_t>(5000 + 28 * u));
    }
  }
  const DepthImage image(std::make_shared<ViewingRays>(k), depth, 1e4);
  Patch patch;
  patch.start({Vec3(0.0, 0.0, 0.58), 0.1});
  image.gather_sides(patch.ball(), {0.01, 0.04}, Patch::capacity, patch);
  EXPECT_EQ(patch.size(), 0U);
}

// 80 x 60 pixels 12.5 mm wide at 0.75 m, whose depth is that of a slope; none where `hole` says so.
DepthImage coarse_slope(const std::function<bool(int u, int v)>& hole, double raised = 0.0) {
  const Intrinsics k{.width = 80, .height = 60, .fx = 60.0, .fy = 60.0, .cx = 40.0, .cy = 30.0};
  std::vector<std::uint16_t> depth;
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      // z = 0.75 + 0.4 x
      const double z = 0.75 / (1.0 - 0.4 * (u - k.cx) / k.fx) - (u < 40 ? raised : 0.0);
      depth.push_back(hole(u, v) ? std::uint16_t{0} : static_cast<std::uint16_t>(z * 5e4 + 0.5));
    }
  }
  return DepthImage(std::make_shared<ViewingRays>(k), depth, 5e4);
}

std::vector<Vec3> sheet_of(const Cloud& cloud, const Vec3& at, double radius) {
  Patch patch;
  patch.start({at, radius});
  cloud.gather_sheet(patch.ball(), {2.5e-3, 10e-3}, Patch::capacity, patch);
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < patch.size(); ++i)
    points.emplace_back(at + Vec3(patch.x()[i], patch.y()[i], patch.z()[i]));
  return points;
}

TEST(DepthImage, FillsASurfaceBetweenCoarsePixelsAsDenselyAsAsked) {
  const DepthImage image = coarse_slope([](int, int) { return false; });
  const Vec3 at(0.01, 0.02, 0.754);
  const std::vector<Vec3> points = sheet_of(image, at, 0.03);
  for (const Vec3& p : points) EXPECT_NEAR(p.z(), 0.75 + 0.4 * p.x(), 2e-5);
  const Vec3 along = Vec3(1.0, 0.0, 0.4).normalized();
  for (double a = -0.02; a <= 0.02; a += 0.001) {
    for (double b = -0.02; b <= 0.02; b += 0.001) {
      const Vec3 place = at + a * along + b * Vec3::UnitY();
      double nearest = 1.0;
      for (const Vec3& p : points) nearest = std::min(nearest, (p - place).norm());
      // Half the diagonal of a part; the pixels' own points are not among them.
      ASSERT_LE(nearest, 2.5e-3) << a << ' ' << b;
    }
  }
  EXPECT_TRUE(sheet_of(image, at * 0.15, 0.03).empty()) << "pixels finer than asked for";
}

TEST(DepthImage, EndsASurfaceHalfAPixelBeyondItsLastAndBridgesNoStep) {
  for (const double raised : {0.0, 0.1}) {
    const bool hole = raised == 0.0;
    const DepthImage image = coarse_slope([&](int u, int) { return hole && u >= 40; }, raised);
    double most = -1.0;
    const double z = 0.75 - raised;
    for (const Vec3& p : sheet_of(image, Vec3(0.0, 0.0, z), 0.03)) {
      if (p.z() < z + 0.02) most = std::max(most, p.x() / p.z());
      if (!hole) {
        EXPECT_LT(std::abs(p.z() - 0.4 * p.x() - z), 0.01) << p.x();
      }
    }
    // The last column is 39, one left of the middle.
    EXPECT_LE(most, -0.5 / 60.0);
    EXPECT_GE(most, -0.65 / 60.0);
  }
}

TEST(CloudSet, FillsTheSurfacesOfEachOfItsCameras) {
  const auto image = std::make_shared<DepthImage>(coarse_slope([](int, int) { return false; }));
  const Vec3 at(0.01, 0.02, 0.754);
  const std::size_t alone = sheet_of(*image, at, 0.03).size();
  EXPECT_EQ(sheet_of(CloudSet({image, image}), at, 0.03).size(), 2 * alone);
}

TEST(CloudSet, GathersTheSidesThatEachOfItsCamerasSees) {
  const BlockBeforeWall one(0.3);
  const BlockBeforeWall other(0.3);
  const std::size_t alone = one.sides(0.0).size();
  const CloudSet both({std::make_shared<DepthImage>(*one.image),
                       std::make_shared<DepthImage>(*other.image),
                       std::make_shared<PointCloud>(one.image->points())});
  const Vec3 edge = Vec3((79.0 - 60.0) / BlockBeforeWall::f, 0.0, 1.0) * 0.5;
  Patch patch;
  patch.start({edge, 0.03});
  both.gather_sides(patch.ball(), {0.01, 0.04}, Patch::capacity, patch);
  EXPECT_EQ(patch.size(), 2 * alone);
}

TEST(CloudSet, KnowsHowFarPointsLieApart) {
  const Intrinsics camera{.width = 8, .height = 6, .fx = 100, .fy = 100, .cx = 4, .cy = 3};
  const auto rays = std::make_shared<ViewingRays>(camera);
  const Eigen::Isometry3d back(Eigen::Translation3d(0, 0, -1));
  const auto near = std::make_shared<DepthImage>(rays, std::vector<std::uint16_t>(48, 500), 1000.0);
  const auto far =
      std::make_shared<DepthImage>(rays, std::vector<std::uint16_t>(48, 1500), 1000.0, back);
  const auto points = std::make_shared<PointCloud>(std::vector<Vec3>{Vec3(0, 0, 1)});
  const Vec3 place(0, 0, 0.5);
  EXPECT_NEAR(near->spacing(place), (*near->deproject(5, 3) - *near->deproject(4, 3)).norm(),
              1e-12);
  EXPECT_NEAR(far->spacing(place), 0.015, 1e-12);
  EXPECT_EQ(near->spacing({0.1, 0, 0.5}), 0.0) << "outside the image";
  EXPECT_EQ(near->spacing({0, 0, -0.5}), 0.0) << "behind the camera";
  EXPECT_EQ(points->spacing(place), 0.0) << "not known";
  EXPECT_NEAR(CloudSet({points, far, near}).spacing(place), 0.005, 1e-12);
  EXPECT_NEAR(CloudSet({near, far}).spacing({0, 0, -0.5}), 0.005, 1e-12);
}

TEST(CloudSet, RefusesMoreCloudsThanAPatchTellsApart) {
  const auto cloud = std::make_shared<BruteForceCloud>(std::vector<Vec3>{});
  EXPECT_THROW(CloudSet({Patch::max_views + 1, cloud}), Error);
  EXPECT_THROW(CloudSet({nullptr}), Error);
}

TEST(ViewingRays, InvertsTheLensDistortionOfARealAzureKinect) {
  Intrinsics k{.width = 640, .height = 576, .fx = 504.6, .fy = 504.7, .cx = 332.8, .cy = 348.8};
  k.distortion = {0.5479397773742676,     -0.020971370860934258, 2.0557534298859537e-05,
                  -7.210415787994862e-05, -0.002652231603860855, 0.8896790742874146,
                  0.08613020926713943,    -0.013910384848713875};
  const ViewingRays rays(k);
  // Far from the centre this lens squeezes the image: a ray lies farther out than a pinhole's.
  const Eigen::Vector2d corner = rays.ray(560, 500);
  EXPECT_GT(corner.norm(), Eigen::Vector2d((560 - k.cx) / k.fx, (500 - k.cy) / k.fy).norm());
  // Put the ray through the distortion, written out here, and arrive at the pixel.
  const double r2 = corner.squaredNorm();
  const auto& d = k.distortion;
  const double radial = (1 + d[0] * r2 + d[1] * r2 * r2 + d[4] * r2 * r2 * r2) /
                        (1 + d[5] * r2 + d[6] * r2 * r2 + d[7] * r2 * r2 * r2);
  const double x = corner.x() * radial + 2 * d[2] * corner.x() * corner.y() +
                   d[3] * (r2 + 2 * corner.x() * corner.x());
  EXPECT_NEAR(x * k.fx + k.cx, 560.0, 1e-6);
}

TEST(DepthImage, RefusesWhatCannotBeACamera) {
  Intrinsics k{.width = 4, .height = 4, .fx = 60, .fy = 60, .cx = 2, .cy = 2};
  const auto with = [&k](auto change) {
    Intrinsics changed = k;
    change(changed);
    return [changed] { ViewingRays{changed}; };
  };
  EXPECT_THROW(with([](Intrinsics& i) { i.fx = 0; })(), Error);
  EXPECT_THROW(with([](Intrinsics& i) { i.fy = -5; })(), Error);
  EXPECT_THROW(with([](Intrinsics& i) { i.fx = std::nan(""); })(), Error);
  EXPECT_THROW(with([](Intrinsics& i) { i.width = 0; })(), Error);
  EXPECT_THROW(with([](Intrinsics& i) { i.height = 1 << 20; })(), Error);
  const auto rays = std::make_shared<ViewingRays>(k);
  EXPECT_THROW(DepthImage(rays, std::vector<std::uint16_t>(15), 1000.0), Error);
  EXPECT_THROW(DepthImage(rays, std::vector<std::uint16_t>(16), 0.0), Error);
  Eigen::Isometry3d sheared = Eigen::Isometry3d::Identity();
  sheared.linear()(0, 1) = 0.1;
  EXPECT_THROW(DepthImage(rays, std::vector<std::uint16_t>(16), 1000.0, sheared), Error);
}

TEST(PointCloud, RefusesASurfaceWhosePartsDoNotFitItsPoints) {
  const std::vector<Vec3> points(3, Vec3::Zero());
  const auto made = [&](const Surface& surface) { return PointCloud(surface).size(); };
  EXPECT_TRUE(test::fails_saying(
      [&] {
        return made({.points = points, .triangles = {{0, 1, 3}}});
      },
      "surface", "vertex number"));
  EXPECT_TRUE(test::fails_saying([&] { return made({.points = points, .columns = 2, .rows = 2}); },
                                 "surface", "columns times rows"));
  EXPECT_TRUE(test::fails_saying(
      [&] { return made({.points = points, .normals = {Vec3::UnitZ()}}); }, "surface", "normals"));
}

TEST(DepthImage, SaysHowNoisyTheReadingIsThatSawAPlace) {
  Intrinsics k{.width = 40, .height = 30, .fx = 40, .fy = 40, .cx = 19.5, .cy = 14.5};
  Eigen::Isometry3d pose(Eigen::Translation3d(0.1, -0.2, 0.3));
  pose.rotate(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  constexpr double usual = 7.0;  // [m]
  for (const bool is_distorted : {false, true}) {
    if (is_distorted) k.distortion = {0.05, -0.02, 1e-3, 1e-3, 0, 0, 0, 0};
    std::vector<std::uint16_t> depth(1200, 800);
    depth[45] = 0;
    DepthImage image(std::make_shared<ViewingRays>(k), depth, 1000.0, pose);
    EXPECT_FALSE(image.has_noise());
    EXPECT_EQ(image.noise_at(3, 2, usual), usual);
    std::vector<float> noise(1200);
    for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = 0.25F * static_cast<float>(i);
    image.set_noise(noise);
    ASSERT_TRUE(image.has_noise());
    for (int v = 0; v < k.height; ++v) {
      for (int u = 0; u < k.width; ++u) {
        const double said = image.noise_at(u, v, usual);
        const auto place = image.deproject(u, v);
        // No reading is better than rounding to its unit, and a hole has none.
        const double truth = std::max(0.25e-3 * (40 * v + u), 1e-3 / std::sqrt(12.0));
        EXPECT_NEAR(said, place ? truth : usual, 1e-12) << u << ' ' << v;
        if (place) {
          EXPECT_EQ(image.noise_at(*place, usual), said) << u << ' ' << v;
        }
      }
    }
    EXPECT_EQ(image.noise_at(pose * Vec3(0, 0, -1), usual), usual) << "behind the camera";
    EXPECT_EQ(image.noise_at(pose * Vec3(1, 0, 1), usual), usual) << "beside the image";
    DepthImage copy = image;
    EXPECT_EQ(copy.noise(), image.noise()) << "shared";
    copy.rescale(2.0);
    EXPECT_NEAR(copy.noise_at(0, 20, usual), 0.4, 1e-12);
  }
}

TEST(DepthImage, RefusesNoiseThatIsNone) {
  const Intrinsics k{.width = 4, .height = 3, .fx = 60, .fy = 60, .cx = 2, .cy = 2};
  DepthImage image(std::make_shared<ViewingRays>(k), std::vector<std::uint16_t>(12, 500), 1000.0);
  for (const float wrong : {std::nanf(""), std::numeric_limits<float>::infinity(), -1e-3F}) {
    std::vector<float> noise(12, 1.0F);
    noise[9] = wrong;
    EXPECT_TRUE(test::fails_saying([&] { return image.set_noise(noise), 0; }, "noise",
                                   std::to_string(wrong), "row 2, column 1", "give"));
  }
  EXPECT_TRUE(test::fails_saying([&] { return image.set_noise(std::vector<float>(11)), 0; },
                                 "noise", "11", "12", "give"));
  EXPECT_FALSE(image.has_noise());
  image.set_noise(std::vector<float>(12, 1e30F));  // all there is room for
  EXPECT_NEAR(image.noise_at(0, 0, 1.0), 4.096, 1e-3);
}

TEST(Clouds, AllGiveTheSameProxyToRounding) {
  // A wavy surface seen by a camera, pressed and stroked; then the same points in each container.
  const Intrinsics k{.width = 320, .height = 240, .fx = 300, .fy = 300, .cx = 160, .cy = 120};
  std::vector<std::uint16_t> depth;
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u)
      depth.push_back(static_cast<std::uint16_t>(5000 * (0.5 + 0.01 * std::sin(u * 0.05))));
  }
  const DepthImage image(std::make_shared<ViewingRays>(k), depth, 10000.0);
  const std::vector<Vec3> points = image.points();
  const PointCloud sorted(points);
  const BruteForceCloud oracle(points);
  Paper a;
  Paper b;
  Paper c;
  a.observe({image, 0});
  b.observe({sorted, 0});
  c.observe({oracle, 0});
  double largest = 0.0;
  for (int i = 0; i < 400; ++i) {
    const Vec3 hip(-0.02 + 1e-4 * i, 0.001, 0.23 + std::min(i, 100) * 2.5e-4);
    const Tick x = a.tick(hip, i * 1e-3);
    const Tick y = b.tick(hip, i * 1e-3);
    const Tick z = c.tick(hip, i * 1e-3);
    ASSERT_LT((x.proxy - z.proxy).norm(), 2e-4) << "tick " << i;
    ASSERT_LT((y.proxy - z.proxy).norm(), 2e-4) << "tick " << i;
    largest = std::max(largest, x.force.norm());
  }
  EXPECT_GT(largest, 1.0);
}

}  // namespace test_clouds
}  // namespace palpate
