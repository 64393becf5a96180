// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "palpate/io/sources/depth_rvl.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_depth_slices {

using test::fails_saying;
using Slice = std::vector<std::byte>;

constexpr int width = 320, height = 90;
constexpr double patience = 0.01;  // [s]

std::vector<std::uint16_t> noisy_depth(unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint16_t> depth(static_cast<std::size_t>(width) * height);
  for (std::uint16_t& raw : depth) raw = static_cast<std::uint16_t>(700 + random() % 16);
  return depth;
}

std::vector<Slice> slices_of(std::uint32_t number, const std::vector<std::uint16_t>& depth) {
  std::vector<Slice> slices;
  encode_depth_slices(number, width, height, depth,
                      [&](auto slice) { slices.emplace_back(slice.begin(), slice.end()); });
  return slices;
}

TEST(DepthSlices, FitIntoPacketsAndMakeTheImageInAnyOrder) {
  const std::vector<std::uint16_t> depth = noisy_depth(1);
  std::vector<Slice> slices = slices_of(7, depth);
  ASSERT_GT(slices.size(), 4U);
  for (const Slice& slice : slices) EXPECT_LE(slice.size(), 1300U);
  std::shuffle(slices.begin(), slices.end(), std::mt19937(1));
  SliceAssembler assembler;
  for (const Slice& slice : slices) {
    EXPECT_FALSE(assembler.take(1.0, patience));
    EXPECT_FALSE(assembler.add(slice, 5.0, 1.0, "a slice"));
    EXPECT_FALSE(assembler.add(slice, 5.0, 1.0, "a slice"));  // twice is once
  }
  const auto image = assembler.take(1.0, patience);
  ASSERT_TRUE(image);
  EXPECT_EQ(assembler.rows_heard(), 2U * height);
  EXPECT_EQ(image->depth, depth);
  EXPECT_EQ(image->number, 7U);
  EXPECT_EQ(image->width, width);
  EXPECT_EQ(image->height, height);
  EXPECT_EQ(image->stamp, 5.0);
  EXPECT_EQ(image->missing, 0);
  EXPECT_FALSE(assembler.take(9.0, patience));
}

// What was lost is a hole of some rows; the image is given after a while, or when a newer one
// begins.
TEST(DepthSlices, GiveWhatCame) {
  const std::vector<std::uint16_t> depth = noisy_depth(2);
  const std::vector<Slice> slices = slices_of(1, depth);
  for (const bool newer_comes : {false, true}) {
    SliceAssembler assembler;
    for (std::size_t i = 0; i < slices.size(); ++i) {
      if (i != 2) assembler.add(slices[i], 5.0, 1.0, "a slice");
    }
    EXPECT_FALSE(assembler.take(1.0 + 0.9 * patience, patience));
    std::optional<SliceAssembler::Image> image;
    if (newer_comes) {
      image = assembler.add(slices_of(2, depth)[0], 5.1, 1.001, "a slice");
    } else {
      image = assembler.take(1.0 + patience, patience);
    }
    ASSERT_TRUE(image);
    EXPECT_GT(image->missing, 0);
    EXPECT_LE(image->missing, 16);
    int holes = 0;
    for (std::size_t i = 0; i < depth.size(); ++i) {
      if (image->depth[i] != depth[i]) {
        EXPECT_EQ(image->depth[i], 0);
        ++holes;
      }
    }
    EXPECT_EQ(holes, image->missing * width);
    // What comes late is of no use, and does not disturb what is newer
    EXPECT_FALSE(assembler.add(slices[2], 5.0, 1.002, "a slice"));
    EXPECT_EQ(assembler.waits_since().has_value(), newer_comes);
  }
}

TEST(DepthSlices, GoOnWhenTheirNumbersGoRound) {
  const std::vector<std::uint16_t> depth = noisy_depth(3);
  SliceAssembler assembler;
  for (const std::uint32_t number : {0xfffffffeU, 0xffffffffU, 0U, 1U}) {
    for (const Slice& slice : slices_of(number, depth)) assembler.add(slice, 5.0, 1.0, "a slice");
    const auto image = assembler.take(1.0, patience);
    ASSERT_TRUE(image) << number;
    EXPECT_EQ(image->depth, depth);
  }
}

TEST(DepthSlices, RejectWhatCannotBe) {
  const std::vector<std::uint16_t> depth = noisy_depth(4);
  const std::vector<Slice> slices = slices_of(1, depth);
  const auto fails = [&](Slice slice, const char* why) {
    SliceAssembler assembler;
    assembler.add(slices[1], 5.0, 1.0, "a slice");
    return fails_saying([&] { return assembler.add(slice, 5.0, 1.0, "a slice"); }, "a slice", why);
  };
  for (std::size_t size = 0; size < slices[0].size(); ++size)
    EXPECT_TRUE(fails({slices[0].begin(), slices[0].begin() + static_cast<std::ptrdiff_t>(size)},
                      "ends too early"))
        << size;
  const auto changed = [&](std::size_t at, int value) {
    Slice slice = slices[2];
    slice[at] = static_cast<std::byte>(value);
    return slice;
  };
  EXPECT_TRUE(fails(changed(4, 90), "beyond its image"));  // first row
  EXPECT_TRUE(fails(changed(4, 89), "beyond its image"));
  EXPECT_TRUE(fails(changed(6, 91), "does not fit"));  // rows
  EXPECT_TRUE(fails(changed(7, 255), "too large"));
  EXPECT_TRUE(fails_saying([&] { slices_of(1, {1, 2, 3}); }, "depth image", "320x90"));
}

}  // namespace test_depth_slices
}  // namespace palpate
