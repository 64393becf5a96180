// SPDX-License-Identifier: Apache-2.0
#include <numeric>
#include <random>
#include <span>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/depth_png.hpp"

#include "tests/support/depth_pngs.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_depth_png {

using test::fails_saying;
using test::png_of;

DepthPng parse(const std::string& bytes) {
  return parse_depth_png(std::as_bytes(std::span(bytes)), "test.png");
}

// Two rows of 0x0102, 0xfffe.
const std::string& small_samples() {
  static const std::string samples("\0\x01\x02\xff\xfe\0\x01\x02\xff\xfe", 10);
  return samples;
}

TEST(DepthPng, ReadsBigEndianValuesRowByRow) {
  const DepthPng image = parse(png_of(2, 2, 16, test::grey, small_samples()));
  EXPECT_EQ(image.width, 2);
  EXPECT_EQ(image.height, 2);
  EXPECT_EQ(image.depth, (std::vector<std::uint16_t>{0x0102, 0xfffe, 0x0102, 0xfffe}));
}

TEST(DepthPng, ReadsAnInterlacedImage) {
  // Adam7 of 2x2: (0,0) in pass 1, (1,0) in pass 6, the second row in pass 7.
  const std::string samples("\0\0\x01\0\0\x02\0\0\x03\0\x04", 11);
  EXPECT_EQ(parse(png_of(2, 2, 16, test::grey, samples, 1)).depth,
            (std::vector<std::uint16_t>{1, 2, 3, 4}));
}

TEST(DepthPng, ReadsWhatItWrote) {
  const test::TemporaryFolder folder;
  std::vector<std::uint16_t> depth(37 * 11);
  std::iota(depth.begin(), depth.end(), std::uint16_t{65200});  // wraps: 0 and 65535 among them
  test::write_depth_png(folder.path() / "depth.png", 37, 11, depth);
  const DepthPng image = read_depth_png(folder.path() / "depth.png");
  EXPECT_EQ(image.width, 37);
  EXPECT_EQ(image.height, 11);
  EXPECT_EQ(image.depth, depth);
}

TEST(DepthPng, RejectsOtherKindsOfPngSayingWhatTheyAre) {
  const std::string samples(64, '\0');
  const auto fails = [&](char bits, test::Colour colour, const char* saying) {
    return fails_saying([&] { return parse(png_of(2, 2, bits, colour, samples)); }, "test.png",
                        saying, "16-bit grey PNG is needed");
  };
  EXPECT_TRUE(fails(8, test::grey, "8-bit grey,"));
  EXPECT_TRUE(fails(1, test::grey, "1-bit grey,"));
  EXPECT_TRUE(fails(8, test::rgb, "8-bit colour,"));
  EXPECT_TRUE(fails(16, test::rgb, "16-bit colour,"));
  EXPECT_TRUE(fails(8, test::palette, "8-bit palette,"));
  EXPECT_TRUE(fails(16, test::grey_alpha, "16-bit grey and alpha,"));
  EXPECT_TRUE(fails(8, test::rgba, "8-bit colour and alpha,"));
}

TEST(GreyPng, WeighsColoursAndTakesEveryKind) {
  const test::TemporaryFolder folder;
  const auto grey_of = [&](char bits, test::Colour colour, const std::string& samples) {
    const LightPng image =
        read_light_png(folder.write("image.png", png_of(1, 2, bits, colour, samples)), false);
    EXPECT_EQ(image.width, 1);
    EXPECT_EQ(image.height, 2);
    return std::vector<int>(image.values.begin(), image.values.end());
  };
  using Values = std::vector<int>;
  EXPECT_EQ(grey_of(8, test::grey, {"\0\x07\0\xff", 4}), (Values{7, 255}));
  EXPECT_EQ(grey_of(1, test::grey, {"\0\x80\0\0", 4}), (Values{255, 0}));
  EXPECT_EQ(grey_of(16, test::grey, {"\0\x80\x80\0\xff\xff", 6}), (Values{128, 255}));
  EXPECT_EQ(grey_of(8, test::grey_alpha, {"\0\x07\0\0\x09\xff", 6}), (Values{7, 9}));
  // Of red, green and blue 0.2126, 0.7152 and 0.0722.
  EXPECT_EQ(grey_of(8, test::rgb, {"\0\xff\0\0\0\x10\x10\x10", 8}), (Values{54, 16}));
  EXPECT_EQ(grey_of(8, test::rgba, {"\0\0\xff\0\0\0\0\0\xff\0", 10}), (Values{182, 18}));
  // The palette's first entry is (97, 98, 99), its second (100, 101, 102); parts are dropped.
  EXPECT_EQ(grey_of(8, test::palette, {"\0\0\0\1", 4}), (Values{97, 100}));
  EXPECT_TRUE(fails_saying([&] { return read_light_png(folder.write("no.png", "none"), false); },
                           "no.png", "not a PNG"));
}

TEST(ColourPng, GivesRedGreenBlueOfEveryKind) {
  const test::TemporaryFolder folder;
  using Values = std::vector<std::uint8_t>;
  const auto colour_of = [&](char bits, test::Colour colour, const std::string& samples) {
    const LightPng image =
        read_light_png(folder.write("image.png", png_of(1, 2, bits, colour, samples)), true);
    EXPECT_EQ(image.width, 1);
    EXPECT_EQ(image.height, 2);
    return image.values;
  };
  EXPECT_EQ(colour_of(8, test::grey, {"\0\x07\0\xff", 4}), (Values{7, 7, 7, 255, 255, 255}));
  EXPECT_EQ(colour_of(8, test::rgb, {"\0\1\2\3\0\4\5\6", 8}), (Values{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(colour_of(8, test::rgba, {"\0\1\2\3\0\0\4\5\6\xff", 10}), (Values{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(colour_of(16, test::grey_alpha, {"\0\x80\x80\0\0\0\xff\xff\0\0", 10}),
            (Values{128, 128, 128, 255, 255, 255}));
  EXPECT_EQ(colour_of(8, test::palette, {"\0\0\0\1", 4}), (Values{'a', 'b', 'c', 'd', 'e', 'f'}));
  EXPECT_TRUE(fails_saying([&] { return read_light_png(folder.write("no.png", "none"), true); },
                           "no.png", "a PNG is needed"));
}

TEST(DepthPng, RejectsWhatIsNoPng) {
  EXPECT_TRUE(fails_saying([] { return parse(""); }, "is empty"));
  EXPECT_TRUE(fails_saying([] { return parse("\x89PNG"); }, "is not a PNG"));
  EXPECT_TRUE(fails_saying([] { return parse("P5 640 480 65535\n123456"); }, "is not a PNG"));
}

TEST(DepthPng, RejectsAHeaderThatPromisesMoreThanTheFileHolds) {
  const auto fails = [](std::uint32_t width, std::uint32_t height, const char* saying) {
    return fails_saying(
        [&] { return parse(png_of(width, height, 16, test::grey, small_samples())); }, saying);
  };
  EXPECT_TRUE(fails(16384, 16384, "promises 16384x16384 pixels, more than"));
  EXPECT_TRUE(fails(16385, 1, "16385x1"));
  EXPECT_TRUE(fails(1, 0x7fffffff, "1x2147483647"));
  EXPECT_TRUE(fails(0x80000000, 1, "damaged"));
  EXPECT_TRUE(fails(0, 2, "damaged"));
  EXPECT_TRUE(fails(2, 3, "damaged"));  // one row less than promised
}

TEST(DepthPng, RejectsAFileCutShortAnywhere) {
  const std::string whole = png_of(2, 2, 16, test::grey, small_samples());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_TRUE(fails_saying([&] { return parse(whole.substr(0, size)); }, "test.png")) << size;
  }
}

TEST(DepthPng, RejectsAFileWithOneByteChanged) {
  const std::string whole = png_of(2, 2, 16, test::grey, small_samples());
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    EXPECT_TRUE(fails_saying([&] { return parse(damaged); }, "test.png")) << at;
  }
}

TEST(DepthPng, PassesOverNotesThatAreDamagedOrUnpackWithoutEnd) {
  std::string with_note = png_of(2, 2, 16, test::grey, small_samples());
  with_note.insert(8 + 25, test::chunk("iCCP", "profile") + test::chunk("zTXt", "no text"));
  EXPECT_EQ(parse(with_note).depth.size(), 4u);
}

TEST(DepthPng, NamesAFileThatCannotBeReadAndASizeThatDoesNotFit) {
  const test::TemporaryFolder folder;
  const auto missing = folder.path() / "missing" / "depth.png";
  EXPECT_TRUE(fails_saying([&] { return read_depth_png(missing); }, missing.string(), "no such"));
  EXPECT_TRUE(fails_saying([&] { return read_depth_png(folder.path()); }, "not a file"));
  const std::vector<std::uint16_t> depth(4);
  EXPECT_TRUE(fails_saying([&] { encode_depth_png(2, 3, depth); }, "4 values", "2x3"));
  EXPECT_TRUE(fails_saying([&] { encode_depth_png(0, 3, depth); }, "0x3"));
}

}  // namespace test_depth_png
}  // namespace palpate
