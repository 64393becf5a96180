// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/material_file.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_material_file {

using test::fails_saying;

constexpr const char* text = R"(
[[material]]
name = "table"
like = "wood"
colour = "#a0522d"
tolerance = 20
stiffness = 450

[[material]]
name = "mat"
friction = 1.2

[[material]]
name = "old mat"
like = "mat"
kinetic_share = 0.5
)";

TEST(MaterialFile, IsReadWithAllThatItSays) {
  const MaterialTable table = parse_materials(text, "t.toml");
  ASSERT_EQ(table.materials.size(), 3U);
  const NamedMaterial& wood = table.materials[0];
  EXPECT_EQ(wood.name, "table");
  EXPECT_EQ(wood.material.stiffness, 450.0);
  EXPECT_EQ(wood.material.friction, standard_material("wood").material.friction);
  EXPECT_EQ(wood.colour, (Colour{0xa0, 0x52, 0x2d}));
  EXPECT_EQ(wood.tolerance, 20.0);
  EXPECT_EQ(table.materials[1].material.friction, 1.2);
  EXPECT_FALSE(table.materials[1].colour);
  EXPECT_EQ(table.materials[2].material.friction, 1.2);
  EXPECT_EQ(table.materials[2].material.kinetic_share, 0.5);
  EXPECT_EQ(table.find(0), nullptr);
  EXPECT_EQ(table.find(2), &table.materials[1].material);
  EXPECT_EQ(table.find(4), nullptr);
}

TEST(MaterialFile, ComesBackFromJsonAsItWas) {
  const MaterialTable table = parse_materials(text, "t.toml");
  const MaterialTable back = materials_from_json(materials_json(table), "recording");
  ASSERT_EQ(back.materials.size(), table.materials.size());
  for (std::size_t i = 0; i < table.materials.size(); ++i) {
    EXPECT_EQ(back.materials[i].name, table.materials[i].name);
    EXPECT_EQ(back.materials[i].colour, table.materials[i].colour);
    for (const MaterialInfo& row : material_table())
      EXPECT_EQ(row.get(back.materials[i].material), row.get(table.materials[i].material))
          << row.name;
  }
  EXPECT_TRUE(fails_saying([] { materials_from_json("[{}]", "bag"); }, "bag", "name"));
  EXPECT_TRUE(fails_saying([] { materials_from_json("[{", "bag"); }, "bag", "damaged"));
}

TEST(MaterialFile, SaysWhichLineIsWrong) {
  const auto refuses = [](const std::string& toml, const std::string& a, const std::string& b) {
    return fails_saying([&] { parse_materials(toml, "m.toml"); }, a, b);
  };
  EXPECT_TRUE(refuses("", "m.toml", "[[material]]"));
  EXPECT_TRUE(refuses("[[material]]\nfriction = 1.0\n", "m.toml:1", "name"));
  EXPECT_TRUE(refuses("[[material]]\nname = 'a'\nfricton = 1.0\n", "m.toml:3", "'friction'"));
  EXPECT_TRUE(refuses("[[material]]\nname = 'a'\nfriction = 9.0\n", "m.toml:3", "friction"));
  EXPECT_TRUE(refuses("[[material]]\nname = 'a'\nfriction = 'b'\n", "m.toml:3", "number"));
  EXPECT_TRUE(refuses("[[material]]\nname = 'a'\ncolour = 'red'\n", "m.toml:3", "#rrggbb"));
  EXPECT_TRUE(refuses("[[material]]\nname = 'a'\nlike = 'wod'\n", "m.toml:3", "'wood'"));
  EXPECT_TRUE(refuses("[[material]]\nname = 'a'\ntolerance = 0\n", "m.toml:3", "1 to 100"));
  EXPECT_TRUE(
      refuses("[[material]]\nname = 'a'\n[[material]]\nname = 'a'\n", "m.toml", "used twice"));
  EXPECT_TRUE(refuses("material = 3\n", "m.toml", "no materials"));
  EXPECT_TRUE(refuses("[[material]\n", "m.toml:1", "docs/materials.md"));
  std::string many;
  for (int i = 0; i < 256; ++i) many += "[[material]]\nname = 'm" + std::to_string(i) + "'\n";
  EXPECT_TRUE(refuses(many, "m.toml", "255"));
  EXPECT_TRUE(fails_saying([] { materials_of("folder/m.toml"); }, "folder/m.toml", "no such file"));
  EXPECT_TRUE(fails_saying([] { materials_of("metl"); }, "'metal'"));
}

// Gives one frame: two pixels, left red and right blue.
class TwoPixels final : public Source {
 public:
  explicit TwoPixels(Frame frame) : frame_(std::move(frame)) {}
  std::optional<Frame> next(double /*timeout*/) override { return std::exchange(frame_, {}); }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  std::optional<Frame> frame_;
  SourceInfo info_{.uri = "two:", .kind = "two pixels"};
};

Frame two_pixels() {
  const auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = 2, .height = 1, .fx = 100, .fy = 100, .cx = 0.5, .cy = 0});
  return {
      .stamp = 0.0,
      .cloud = std::make_shared<DepthImage>(rays, std::vector<std::uint16_t>{500, 500}, 1000.0)};
}

std::vector<int> labels_of(Frame frame, Materials materials) {
  const auto source =
      with_materials(std::make_unique<TwoPixels>(std::move(frame)), std::move(materials));
  const Frame felt = *source->next();
  const auto& image = dynamic_cast<const DepthImage&>(*felt.cloud);
  EXPECT_TRUE(image.has_materials());
  std::vector<int> labels;
  for (int u = 0; u < 2; ++u)
    labels.push_back(image.materials()->label(static_cast<std::size_t>(u), *image.deproject(u, 0)));
  return labels;
}

TEST(WithMaterials, TellsThemByLabelsColoursOrNotAtAll) {
  const auto table = std::make_shared<const MaterialTable>(parse_materials(
      "[[material]]\nname='r'\ncolour='#e01010'\n[[material]]\nname='b'\ncolour='#1010e0'\n", "t"));
  const std::vector<std::uint8_t> red_and_blue{0xe0, 0x12, 0x10, 0x10, 0x14, 0xd8};
  using Labels = std::vector<int>;

  Frame frame = two_pixels();
  EXPECT_TRUE(fails_saying([&] { labels_of(frame, {.table = table}); }, "two:", "colour"));
  frame.colour = std::make_shared<const ColourImage>(ColourImage{2, 1, red_and_blue});
  EXPECT_EQ(labels_of(frame, {.table = table}), (Labels{1, 2}));
  // A colour camera 1 cm to the left, which sees both as its own right half does.
  ColourImage beside{2, 1, red_and_blue};
  beside.camera = ColourImage::Camera{
      .intrinsics = {.width = 2, .height = 1, .fx = 50, .fy = 50, .cx = 0.5, .cy = 0}};
  beside.camera->world_from_camera.translation() = Vec3(-0.01, 0, 0);
  frame.colour = std::make_shared<const ColourImage>(beside);
  EXPECT_EQ(labels_of(frame, {.table = table}), (Labels{2, 0})) << "the second is out of its sight";
  frame.labels = std::make_shared<const std::vector<std::uint8_t>>(std::vector<std::uint8_t>{2, 0});
  EXPECT_EQ(labels_of(frame, {.table = table}), (Labels{2, 0}));
  frame.labels = std::make_shared<const std::vector<std::uint8_t>>(std::vector<std::uint8_t>{2});
  EXPECT_TRUE(fails_saying([&] { labels_of(frame, {.table = table}); }, "two:", "same size"));
  EXPECT_EQ(labels_of(two_pixels(), materials_of("rubber")), (Labels{1, 1}));
}

TEST(ColourKey, TakesTheNearestColourWithinItsTolerance) {
  const MaterialTable table = parse_materials(
      "[[material]]\nname='dark'\ncolour='#202020'\ntolerance=25\n"
      "[[material]]\nname='red'\ncolour='#c02020'\ntolerance=40\n",
      "t");
  const ColourKey key(table);
  const auto label = [&](Colour colour) { return static_cast<int>(key.label(colour.data())); };
  EXPECT_EQ(label({0x20, 0x20, 0x20}), 1);
  EXPECT_EQ(label({0x38, 0x30, 0x30}), 1);
  EXPECT_EQ(label({0xc0, 0x20, 0x20}), 2);
  EXPECT_EQ(label({0xa8, 0x30, 0x28}), 2);
  EXPECT_EQ(label({0x20, 0xe0, 0x20}), 0);
  EXPECT_EQ(label({0xff, 0xff, 0xff}), 0);
}

}  // namespace test_material_file
}  // namespace palpate
