// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/material_file.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/session/paint.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_paint {

using test::fails_saying;

constexpr int width = 80;
constexpr int height = 60;

// A wall across the line of sight, 2.5 mm a pixel at 0.5 m; a hole in its corner.
std::shared_ptr<DepthImage> wall(double distance, std::shared_ptr<const MaterialMap> map = {}) {
  static const auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = width, .height = height, .fx = 200, .fy = 200, .cx = 39.5, .cy = 29.5});
  std::vector<std::uint16_t> depth(std::size_t{width} * height,
                                   static_cast<std::uint16_t>(std::lround(distance * 1e4)));
  depth[0] = 0;
  auto image = std::make_shared<DepthImage>(rays, std::move(depth), 1e4);
  image->set_materials(std::move(map));
  return image;
}

Dab dab(const Vec3& place, double radius, const std::string& material) {
  return {.place = place, .radius = radius, .material = material};
}

// The material under a place; "" for none.
std::string at(const Cloud& cloud, int u, int v) {
  const auto& image = dynamic_cast<const DepthImage&>(cloud);
  if (!image.materials()) return "";
  const auto label =
      image.materials()->label(static_cast<std::size_t>(v * width + u), Vec3::Zero());
  return label == 0 ? "" : image.materials()->table()->materials.at(label - 1U).name;
}

TEST(Paint, IsWhereItWasPaintedAndNowhereElse) {
  Paint paint;
  const auto bare = wall(0.5);
  EXPECT_EQ(paint.on(bare, 0), bare) << "no paint, no other frame";
  paint.add(dab(*bare->deproject(40, 30), 0.01, "rubber"));
  const auto painted = paint.on(bare, 0);
  EXPECT_EQ(at(*painted, 40, 30), "rubber");
  EXPECT_EQ(at(*painted, 43, 30), "rubber");
  EXPECT_EQ(at(*painted, 45, 30), "") << "12 mm away";
  EXPECT_EQ(at(*painted, 40, 35), "");
  paint.add(dab(*bare->deproject(44, 30), 0.01, "ice"));
  EXPECT_EQ(at(*paint.on(bare, 0), 44, 30), "ice") << "the last one counts";
  paint.erase(*bare->deproject(44, 30), 0.005);
  EXPECT_EQ(at(*paint.on(bare, 0), 47, 30), "");
  EXPECT_EQ(at(*paint.on(bare, 0), 43, 30), "rubber");
  paint.clear();
  EXPECT_EQ(paint.on(bare, 0), bare);
}

TEST(Paint, StaysOnASurfaceThatComesAndGoes) {
  Paint paint;
  paint.add(dab(*wall(0.5)->deproject(40, 30), 0.01, "foam"));
  double distance = 0.5;
  for (int i = 1; i <= 60; ++i) {  // 0.15 m to and fro, at 30 Hz up to 0.5 m/s
    distance = 0.5 + 0.15 * std::sin(0.1 * i);
    const auto painted = paint.on(wall(distance), 0);
    ASSERT_EQ(at(*painted, 40, 30), "foam") << i;
    ASSERT_NEAR(paint.dabs().front().place.z(), distance, 1e-3) << i;
  }
  // What comes between hides it and is not painted; behind it, it is still there.
  EXPECT_EQ(at(*paint.on(wall(distance - 0.2), 0), 40, 30), "");
  EXPECT_EQ(at(*paint.on(wall(distance), 0), 40, 30), "foam");
  // Other cameras see it where the first one does.
  EXPECT_EQ(at(*paint.on(wall(distance + 0.03), 1), 40, 30), "foam");
  EXPECT_NEAR(paint.dabs().front().place.z(), distance, 1e-3);
}

TEST(Paint, GoesOverTheCamerasOwnMaterials) {
  const auto table = std::make_shared<const MaterialTable>(
      parse_materials("[[material]]\nname='felt'\nfriction=0.7\n", "t"));
  const auto map = std::make_shared<LabelImage>(
      table, std::vector<std::uint8_t>(std::size_t{width} * height, std::uint8_t{1}),
      std::vector<std::uint8_t>(std::size_t{width} * height, std::uint8_t{9}));
  const auto seen = wall(0.5, map);
  Paint paint;
  paint.add(dab(*seen->deproject(40, 30), 0.01, "ice"));
  const auto painted = paint.on(seen, 0);
  EXPECT_EQ(at(*painted, 40, 30), "ice");
  EXPECT_EQ(at(*painted, 10, 10), "felt");
  const auto& image = dynamic_cast<const DepthImage&>(*painted);
  EXPECT_EQ(image.materials()->brightness(5, Vec3::Zero()), 9);
  paint.add(dab(*seen->deproject(20, 30), 0.01, "felt"));
  EXPECT_EQ(Paint::names(*seen).front(), "felt");
  EXPECT_EQ(Paint::names(*wall(0.5)).front(), standard_materials().materials.front().name);
}

TEST(Paint, RefusesWhatCannotBe) {
  Paint paint;
  EXPECT_TRUE(
      fails_saying([&] { return paint.add(dab(Vec3(0, 0, 0.5), 0.01, "rubbr")), 0; }, "'rubber'"));
  EXPECT_TRUE(
      fails_saying([&] { return paint.add(dab(Vec3(0, 0, 0.5), 0.0, "ice")), 0; }, "radius"));
  EXPECT_TRUE(fails_saying(
      [&] { return paint.add(dab(Vec3(std::nan(""), 0, 0.5), 0.01, "ice")), 0; }, "position"));
  for (int i = 0; i < 50; ++i) paint.add(dab(Vec3(0.001 * (i % 3), 0, 0.5), 0.01, "ice"));
  EXPECT_EQ(paint.dabs().size(), 1U) << "a dab on another one takes its place";
  for (std::size_t i = paint.dabs().size(); i < Paint::most; ++i)
    paint.add(dab(Vec3(0.1 * static_cast<double>(i), 0, 0.5), 0.01, "ice"));
  EXPECT_TRUE(
      fails_saying([&] { return paint.add(dab(Vec3(0, 1, 0.5), 0.01, "ice")), 0; }, "clear"));
}

}  // namespace test_paint
}  // namespace palpate
