// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/session/press_path.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace {

using test::fails_saying;

constexpr int width = 64;
constexpr int height = 48;

Intrinsics camera() {
  Intrinsics k;
  k.width = width;
  k.height = height;
  k.fx = k.fy = 60.0;
  k.cx = 31.5;
  k.cy = 23.5;
  return k;
}

// Depth in 0.1 mm; 0 is a hole.
DepthImage image_of(const std::function<double(int, int)>& depth,
                    const Eigen::Isometry3d& pose = Eigen::Isometry3d::Identity()) {
  std::vector<std::uint16_t> raw;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u)
      raw.push_back(static_cast<std::uint16_t>(std::lround(1e4 * depth(u, v))));
  }
  return {std::make_shared<const ViewingRays>(camera()), std::move(raw), 1e4, pose};
}

TEST(PressPath, GoesAlongTheLineOfSightFromAboveIntoTheSurfaceAndBack) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(0.5, Vec3::UnitX()).matrix();
  pose.translation() = Vec3(1, 2, 3);
  const DepthImage image = image_of([](int, int) { return 0.5; }, pose);
  const Pixel at{40, 10};
  const HipPath path = press_path(image, at, {}, 7.0);
  const Vec3 surface = surface_at(image, at);
  const Vec3 sight = (surface - pose.translation()).normalized();
  EXPECT_NEAR((pose.inverse() * surface).z(), 0.5, 1e-12);
  const auto& s = path.samples();
  ASSERT_EQ(s.size(), 4U);
  EXPECT_EQ(s[0].t, 7.0);
  EXPECT_LT((s[0].hip - (surface - 0.06 * sight)).norm(), 1e-12);
  EXPECT_LT((s[1].hip - (surface + 0.008 * sight)).norm(), 1e-12);
  EXPECT_NEAR(s[1].t - s[0].t, 0.068 / 0.05, 1e-12);
  EXPECT_EQ(s[2].hip, s[1].hip);
  EXPECT_NEAR(s[2].t - s[1].t, 0.5, 1e-12);
  EXPECT_LT((s[3].hip - s[0].hip).norm(), 1e-12);
}

TEST(PressPath, SlidesAlongTheSurfaceAtItsSpeed) {
  // A slope, with a hole on the way.
  const DepthImage image =
      image_of([](int u, int v) { return u > 28 && u < 36 && v > 5 ? 0.0 : 0.4 + 0.002 * u; });
  PressOptions options;
  options.slide_to = Pixel{50, 24};
  options.depth = 0.005;
  options.speed = 0.1;
  options.hold = 0.0;
  const Pixel at{12, 24};
  const HipPath path = press_path(image, at, options);
  const auto& s = path.samples();
  EXPECT_NEAR((s[1].hip - surface_at(image, at)).norm(), 0.005, 1e-12);
  EXPECT_NEAR((s[s.size() - 2].hip - surface_at(image, {50, 24})).norm(), 0.005, 1e-9);
  for (std::size_t i = 1; i < s.size(); ++i) {
    const double speed = (s[i].hip - s[i - 1].hip).norm() / (s[i].t - s[i - 1].t);
    EXPECT_LE(speed, 0.1 + 1e-9) << i;
    EXPECT_LT(std::abs(s[i].hip.y()), 0.01) << "in the row of both pixels";
  }
  const Vec3 way = surface_at(image, {50, 24}) - surface_at(image, at);
  EXPECT_NEAR(s[s.size() - 2].t - s[1].t, way.norm() / 0.1, 0.5 * way.norm() / 0.1);
}

TEST(PressPath, PressesTheMedianOfANoisySurface) {
  const DepthImage image = image_of([](int u, int v) {
    if (u == 20 && v == 20) return 0.0;   // a hole at the pixel itself
    return (u + v) % 5 == 0 ? 0.9 : 0.5;  // outliers
  });
  EXPECT_NEAR(surface_at(image, {20, 20}).z(), 0.5, 1e-12);
}

TEST(PressPath, SaysWhereSomethingIsMeasuredIfNothingIsThere) {
  const DepthImage image = image_of([](int u, int) { return u < 20 ? 0.5 : 0.0; });
  EXPECT_TRUE(fails_saying(
      [&] {
        return press_path(image, {40, 11}), 0;
      },
      "pixel 40,11", "nothing was measured", "nearest measured pixel is 19,11"));
  EXPECT_TRUE(fails_saying(
      [&] {
        return press_path(image, {64, 0}), 0;
      },
      "pixel 64,0", "outside", "0 to 63"));
  EXPECT_TRUE(fails_saying([&] { return press_path(image, {-1, 0}), 0; }, "outside"));
  const DepthImage empty = image_of([](int, int) { return 0.0; });
  EXPECT_TRUE(fails_saying([&] { return press_path(empty, {1, 1}), 0; }, "whole frame is empty"));
  PressOptions options;
  options.slide_to = Pixel{40, 11};
  EXPECT_TRUE(fails_saying([&] { return press_path(image, {4, 11}, options), 0; }, "pixel 40,11"));
  EXPECT_TRUE(fails_saying(
      [&] {
        return press_path(image, {4, 11}, {.depth = 1.0}), 0;
      },
      "press depth", "0 to 0.1 m"));
  EXPECT_TRUE(fails_saying(
      [&] {
        return press_path(image, {4, 11}, {.speed = 0.0}), 0;
      },
      "press speed"));
}

TEST(ParsePixel, ReadsColumnAndRow) {
  EXPECT_EQ(parse_pixel("320,240", "--at").u, 320);
  EXPECT_EQ(parse_pixel("320,240", "--at").v, 240);
  for (const char* bad : {"", "3", "3,", ",4", "3,4,5", "a,4", "3;4", "3,4 ", "1.5,2"}) {
    EXPECT_TRUE(fails_saying([&] { return parse_pixel(bad, "--at"), 0; }, "--at", "320,240"));
  }
}

}  // namespace
}  // namespace palpate
