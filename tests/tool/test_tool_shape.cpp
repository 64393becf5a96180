// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/tool/least_motion.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"

namespace palpate {
namespace {

std::shared_ptr<const ToolShape> made(const std::string& text) { return make_tool(text, {}); }

std::string refusal(const std::string& text) {
  try {
    made(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ToolShape, HasTheSidesOfABoxInOrderAndItsCorners) {
  const auto box = made("box:5x40x20mm");
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();
  for (const auto& point : box->points()) {
    low = low.cwiseMin(point.at);
    high = high.cwiseMax(point.at);
    const Vec3 scaled = point.at.cwiseQuotient(Vec3(20e-3, 10e-3, 2.5e-3));
    EXPECT_NEAR(scaled.cwiseAbs().maxCoeff(), 1.0, 1e-9);
    EXPECT_LT(point.inward.dot(point.at), 0.0);
    EXPECT_NEAR(point.inward.norm(), 1.0, 1e-9);
  }
  EXPECT_TRUE(high.isApprox(Vec3(20e-3, 10e-3, 2.5e-3), 1e-12));
  EXPECT_TRUE(low.isApprox(-high, 1e-12));
  EXPECT_EQ(box->points().size(), ToolShape::usual_points);
  int corners = 0;
  for (const auto& point : box->points()) corners += point.at.norm() > box->reach() - 1e-9 ? 1 : 0;
  EXPECT_EQ(corners, 8);
}

TEST(ToolShape, IsSampledEvenly) {
  for (const char* text : {"box:40x20x5mm", "capsule:80x8mm", "cylinder:60x10mm", "cone:60x6mm",
                           "gripper:40x30x8mm"}) {
    const auto shape = made(text);
    const auto& points = shape->points();
    EXPECT_GT(points.size(), 1500u) << text;
    // No point of a finer level is farther from the coarser one than that is spaced.
    const std::size_t coarse = 300;
    double farthest = 0.0, nearest = 1.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      double away = 1.0;
      for (std::size_t k = 0; k < coarse; ++k)
        if (k != i) away = std::min(away, (points[i].at - points[k].at).norm());
      if (i < coarse) nearest = std::min(nearest, away);
      farthest = std::max(farthest, away);
    }
    EXPECT_LE(farthest, 2.0 * nearest) << text;
    for (const auto& point : points) EXPECT_LT(point.patch, ToolShape::most_patches);
  }
}

TEST(ToolShape, HasItsNormalsInwards) {
  const auto capsule = made("capsule:80x8mm");
  for (const auto& point : capsule->points()) {
    const Vec3 axis(std::clamp(point.at.x(), -36e-3, 36e-3), 0, 0);
    EXPECT_NEAR((point.at - axis).norm(), 4e-3, 2e-5);
    EXPECT_LT(point.inward.dot((point.at - axis).normalized()), -0.9);
  }
}

TEST(ToolShape, IsThickerByItsMargin) {
  const Vec3 half(20e-3, 10e-3, 2.5e-3);
  const auto box = made("box:40x20x5mm?margin=2mm");
  for (const auto& point : box->points()) {
    // To the box: the margin at a face, half of it at least to the planes of an edge.
    const Vec3 beyond = point.at.cwiseAbs() - half;
    EXPECT_NEAR(beyond.cwiseMax(0.0).norm(), 2e-3, 1e-9);
    EXPECT_GT(beyond.maxCoeff(), 1e-3);
  }
  EXPECT_NEAR(box->reach(), made("box:40x20x5mm")->reach() + 2e-3, 1e-3);
  EXPECT_EQ(box->surface().points.size(), made("box:40x20x5mm")->surface().points.size());
}

TEST(ToolShape, IsTurnedWithAllOfIt) {
  const auto box = made("box:40x20x5mm");
  const Rotation turn = rotation_by({0.3, -1.0, 2.0});
  const ToolShape turned = box->turned(turn);
  ASSERT_EQ(turned.points().size(), box->points().size());
  for (std::size_t i = 0; i < turned.points().size(); ++i) {
    EXPECT_LT((turned.points()[i].at - turn * box->points()[i].at).norm(), 1e-12);
    EXPECT_LT((turned.points()[i].inward - turn * box->points()[i].inward).norm(), 1e-12);
    EXPECT_EQ(turned.points()[i].patch, box->points()[i].patch);
  }
  EXPECT_LT((turned.surface().points[3] - turn * box->surface().points[3]).norm(), 1e-12);
  EXPECT_EQ(turned.text(), box->text());
  EXPECT_EQ(turned.reach(), box->reach());
}

TEST(ToolShape, IsHeldAsToldByItsSpecification) {
  // The needle's point, +x, turns down; its blunt end is at the hand.
  const auto needle = made("cone:60x6mm?z=-30mm&pitch=90deg");
  Vec3 tip = Vec3::Zero(), end = Vec3(0.0, 0.0, -1.0);
  for (const auto& point : needle->points()) {
    if (point.at.z() < tip.z()) tip = point.at;
    if (point.at.z() > end.z()) end = point.at;
  }
  EXPECT_LT((tip - Vec3(0.0, 0.0, -60e-3)).norm(), 1e-9);
  EXPECT_NEAR(end.z(), 0.0, 1e-9);
  EXPECT_NEAR(needle->reach(), 60e-3, 1e-9);
  // Roll, then pitch, then yaw, about the hand's axes: x becomes -z, and -z stays.
  const auto box = made("box:40x20x5mm?roll=90deg&pitch=90deg&yaw=90deg&x=10mm");
  Vec3 half = Vec3::Zero();
  for (const auto& point : box->points()) half = half.cwiseMax(point.at - Vec3(10e-3, 0.0, 0.0));
  EXPECT_LT((half - Vec3(2.5e-3, 10e-3, 20e-3)).norm(), 1e-9) << half.transpose();
}

TEST(ToolShape, GivesABallToOtherMethods) { EXPECT_EQ(made("ball"), nullptr); }

TEST(ToolShape, SaysWhatIsWrong) {
  EXPECT_NE(refusal("box:40x20mm").find("needs 3"), std::string::npos);
  EXPECT_NE(refusal("box:40x20x5").find("no unit"), std::string::npos);
  EXPECT_NE(refusal("box:40x20x5km").find("'km' is no unit"), std::string::npos);
  EXPECT_NE(refusal("spoon:40mm").find("'spoon'"), std::string::npos);
  EXPECT_NE(refusal("capsule:4x8mm").find("shorter"), std::string::npos);
  EXPECT_NE(refusal("box:9x9x9m").find("between"), std::string::npos);
  EXPECT_NE(refusal("mesh:a.stl").find("unit"), std::string::npos);
  EXPECT_NE(refusal("box:40x20x5mm?poinst=3").find("points"), std::string::npos);
  EXPECT_NE(refusal("box:40x20x5mm?origin=file").find("origin"), std::string::npos);
  EXPECT_NE(refusal("box:40x20x5mm?pitch=3mm").find("pitch"), std::string::npos);
  EXPECT_NE(refusal("box:40x20x5mm?x=2m").find("'x'"), std::string::npos);
}

TEST(LeastMotion, IsTheNearestPointOfAWedge) {
  // x >= 1 and x + y >= 3, from the origin: (1.5, 1.5).
  std::array<MotionLimit, 2> limits{};
  for (MotionLimit& limit : limits) limit.direction.setZero();
  limits[0].direction[0] = 1.0;
  limits[0].least = 1.0;
  limits[1].direction[0] = limits[1].direction[1] = 1.0;
  limits[1].least = 3.0;
  Motion6 motion = Motion6::Zero();
  const HeldBy held = least_motion(limits, motion);
  EXPECT_TRUE(held.all_met);
  EXPECT_EQ(held.count, 1u);
  EXPECT_NEAR(motion[0], 1.5, 1e-12);
  EXPECT_NEAR(motion[1], 1.5, 1e-12);
}

// The conditions of Karush, Kuhn and Tucker, which the least motion alone meets.
TEST(LeastMotion, MeetsTheConditionsOfAMinimum) {
  std::uint32_t seed = 1;
  const auto random = [&seed] {
    seed = seed * 1664525u + 1013904223u;
    return static_cast<double>(seed >> 8u) / (1u << 23u) - 1.0;
  };
  for (int round = 0; round < 500; ++round) {
    std::array<MotionLimit, 40> limits{};
    for (MotionLimit& limit : limits) {
      for (int i = 0; i < 6; ++i) limit.direction[i] = random();
      limit.least = 0.5 * random() - 0.2;
      limit.direction[0] += 1.0;  // all leave a way out
    }
    Motion6 wanted;
    for (int i = 0; i < 6; ++i) wanted[i] = 3.0 * random();
    Motion6 motion = wanted;
    const HeldBy held = least_motion(limits, motion);
    ASSERT_TRUE(held.all_met) << round;
    Motion6 pushed = wanted;
    for (std::size_t i = 0; i < held.count; ++i) {
      EXPECT_GE(held.push[i], -1e-9);
      const MotionLimit& limit = limits[held.limit[i]];
      EXPECT_NEAR(limit.direction.dot(motion), limit.least, 1e-7);
      pushed += held.push[i] * limit.direction;
    }
    EXPECT_LT((pushed - motion).norm(), 1e-6);
    for (const MotionLimit& limit : limits)
      EXPECT_GE(limit.direction.dot(motion) - limit.least, -1e-7);
  }
}

TEST(LeastMotion, EndsWhereLimitsContradict) {
  std::array<MotionLimit, 2> limits{};
  for (MotionLimit& limit : limits) limit.direction.setZero();
  limits[0].direction[0] = 1.0;
  limits[0].least = 1.0;
  limits[1].direction[0] = -1.0;
  limits[1].least = 0.5;
  Motion6 motion = Motion6::Zero();
  EXPECT_FALSE(least_motion(limits, motion).all_met);
  EXPECT_NEAR(motion[0], 1.0, 1e-12);  // the more violated one
}

}  // namespace
}  // namespace palpate
