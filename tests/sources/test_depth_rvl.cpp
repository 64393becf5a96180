// SPDX-License-Identifier: Apache-2.0
#include <numeric>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/depth_rvl.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_depth_rvl {

using test::fails_saying;

std::vector<std::byte> bytes_of(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

DepthPng parse(const std::vector<std::byte>& bytes) { return parse_depth_rvl(bytes, "a message"); }

// By hand, as the code's paper has it: two zeros (2), two values (2), +5 (10 is A, 1), +1 (2), a
// zero (1), a value (1), +1 (2).
TEST(DepthRvl, IsWhatItsPaperSays) {
  const std::vector<std::uint16_t> depth{0, 0, 5, 6, 0, 7};
  const std::vector<std::byte> bytes = bytes_of({3, 0, 0, 0, 2, 0, 0, 0, 0x12, 0x21, 0xa1, 0x22});
  EXPECT_EQ(encode_depth_rvl(3, 2, depth), bytes);
  const DepthPng image = parse(bytes);
  EXPECT_EQ(image.width, 3);
  EXPECT_EQ(image.height, 2);
  EXPECT_EQ(image.depth, depth);
}

TEST(DepthRvl, ReadsWhatItWrote) {
  std::mt19937 random(1);
  for (const int holes : {0, 1, 2, 9, 10}) {
    std::vector<std::uint16_t> depth(37 * 11);
    for (std::uint16_t& raw : depth) {
      const bool is_hole = static_cast<int>(random() % 10) < holes;
      raw = is_hole ? std::uint16_t{0} : static_cast<std::uint16_t>(random());
    }
    depth[5] = 65535;
    depth[6] = 1;
    EXPECT_EQ(parse(encode_depth_rvl(37, 11, depth)).depth, depth) << holes;
  }
  const std::vector<std::uint16_t> zeros(64);
  EXPECT_EQ(parse(encode_depth_rvl(8, 8, zeros)).depth, zeros);
}

TEST(DepthRvl, RejectsAMessageCutShortAnywhere) {
  std::vector<std::uint16_t> depth(20 * 10);
  std::iota(depth.begin(), depth.end(), std::uint16_t{500});
  const std::vector<std::byte> whole = encode_depth_rvl(20, 10, depth);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::vector<std::byte> cut(whole.begin(),
                                     whole.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_TRUE(fails_saying([&] { return parse(cut); }, "a message", "damaged")) << size;
  }
}

TEST(DepthRvl, RejectsWhatCannotBe) {
  const auto fails = [](std::initializer_list<int> bytes, const char* why) {
    return fails_saying([&] { return parse(bytes_of(bytes)); }, "a message", why);
  };
  EXPECT_TRUE(fails({0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0}, "0x2 pixels"));
  EXPECT_TRUE(fails({0, 64, 0, 0, 0, 64, 0, 0, 0, 0, 0, 0}, "16384x16384 pixels"));
  EXPECT_TRUE(fails({255, 255, 255, 255, 1, 0, 0, 0, 0, 0, 0, 0}, "4294967295x1 pixels"));
  EXPECT_TRUE(
      fails({2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0x30}, "different number of pixels"));  // three zeros
  EXPECT_TRUE(
      fails({2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}, "different number of pixels"));  // none at all
  EXPECT_TRUE(fails({2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0x10, 0x02}, "out of range"));  // below 0
  EXPECT_TRUE(fails({2, 0, 0, 0, 1, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255}, "digits"));
}

TEST(DepthRvl, RejectsSizesThatDoNotMatch) {
  const std::vector<std::uint16_t> depth(6);
  EXPECT_TRUE(fails_saying([&] { return encode_depth_rvl(3, 3, depth); }, "depth image", "3x3"));
  EXPECT_TRUE(fails_saying([&] { return encode_depth_rvl(-3, -2, depth); }, "-3x-2"));
}

}  // namespace test_depth_rvl
}  // namespace palpate
