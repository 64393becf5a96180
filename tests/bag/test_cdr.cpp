// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/bag/cdr.hpp"
#include "palpate/io/bag/messages.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_cdr {

using test::fails_saying;

std::vector<std::byte> bytes_of(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

TEST(Cdr, LiesInMemoryAsTheStandardSays) {
  CdrWriter writer;
  writer(std::uint8_t{7}, std::uint32_t{0x01020304}, std::string("ab"), 1.0);
  // Header; 7 and three to the next multiple of 4; the number; length 3, "ab", NUL and one to the
  // next multiple of 8 behind 15; the double.
  EXPECT_EQ(writer.take(), bytes_of({0, 1, 0,   0,   7, 0, 0, 0, 4, 3, 2, 1, 3,    0,
                                     0, 0, 'a', 'b', 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f}));
}

TEST(Cdr, ReadsBigEndianToo) {
  const auto bytes = bytes_of({0, 0, 0, 0, 7, 0, 0, 0, 1, 2, 3, 4, 0, 0, 0, 3, 'a', 'b', 0});
  CdrReader reader(bytes, "message");
  std::uint8_t small = 0;
  std::uint32_t large = 0;
  std::string text;
  reader(small, large, text);
  EXPECT_EQ(small, 7);
  EXPECT_EQ(large, 0x01020304U);
  EXPECT_EQ(text, "ab");
  EXPECT_TRUE(fails_saying([&] { reader(small); }, "message", "too early"));
}

TEST(Cdr, RefusesWhatPromisesMoreThanItHolds) {
  const auto bytes = bytes_of({0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 1, 2, 3, 4});
  std::vector<double> numbers;
  std::string text;
  EXPECT_TRUE(fails_saying([&] { CdrReader(bytes, "it")(numbers); }, "it", "4294967295"));
  EXPECT_TRUE(fails_saying([&] { CdrReader(bytes, "it")(text); }, "it"));
}

TEST(Cdr, NamesOtherRepresentations) {
  const auto parameter_list = bytes_of({0, 3, 0, 0, 0, 0});
  EXPECT_TRUE(fails_saying([&] { return CdrReader(parameter_list, "it"); }, "it", "CDR"));
  EXPECT_TRUE(fails_saying([&] { return CdrReader(bytes_of({0, 1}), "it"); }, "too short"));
}

TEST(Messages, ComeBackAsTheyWere) {
  const ros::Header header{{-5, 999'999'999}, "camera"};
  const ros::CameraInfo info{.header = header,
                             .height = 480,
                             .width = 640,
                             .distortion_model = "rational_polynomial",
                             .d = {0.1, -0.2, 1e-300, 4.0},
                             .k = {525.5, 0, 319.5, 0, 525.25, 239.5, 0, 0, 1},
                             .r = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                             .p = {525.5, 0, 319.5, 0, 0, 525.25, 239.5, 0, 0, 0, 1, 0},
                             .binning_x = 1,
                             .binning_y = 2,
                             .roi = {1, 2, 3, 4},
                             .do_rectify = true};
  const auto back = ros::decode<ros::CameraInfo>(ros::encode(info), "info");
  EXPECT_EQ(back.header.stamp.nanoseconds(), -4'000'000'001);
  EXPECT_EQ(back.header.frame_id, "camera");
  EXPECT_EQ(back.distortion_model, info.distortion_model);
  EXPECT_EQ(back.d, info.d);
  EXPECT_EQ(back.k, info.k);
  EXPECT_EQ(back.p, info.p);
  EXPECT_EQ(back.roi, info.roi);
  EXPECT_TRUE(back.do_rectify);

  const ros::PointCloud2 cloud{.header = header,
                               .width = 1,
                               .fields = {{"x", 0, 7}, {"intensity", 4, 7, 3}},
                               .point_step = 16,
                               .row_step = 16,
                               .data = std::vector<std::byte>(16, std::byte{9}),
                               .is_dense = false};
  const auto points = ros::decode<ros::PointCloud2>(ros::encode(cloud), "cloud");
  ASSERT_EQ(points.fields.size(), 2U);
  EXPECT_EQ(points.fields[1].name, "intensity");
  EXPECT_EQ(points.fields[1].count, 3U);
  EXPECT_EQ(points.data, cloud.data);
  EXPECT_FALSE(points.is_dense);

  const double nan = std::numeric_limits<double>::quiet_NaN();
  const ros::Float64MultiArray array{"label", {nan, -0.0, 5e-324}};
  const auto numbers = ros::decode<ros::Float64MultiArray>(ros::encode(array), "array");
  EXPECT_EQ(numbers.label, "label");
  ASSERT_EQ(numbers.data.size(), 3U);
  EXPECT_TRUE(std::isnan(numbers.data[0]));
  EXPECT_TRUE(std::signbit(numbers.data[1]));
  EXPECT_EQ(numbers.data[2], 5e-324);

  const ros::TFMessage transforms{{{header, "child", {1, 2, 3}, {0, 0.6, 0, 0.8}}}};
  const auto moved = ros::decode<ros::TFMessage>(ros::encode(transforms), "tf").transforms;
  ASSERT_EQ(moved.size(), 1U);
  EXPECT_EQ(moved[0].child_frame_id, "child");
  EXPECT_EQ(moved[0].rotation, transforms.transforms[0].rotation);
}

TEST(Messages, CutAnywhereAreAnError) {
  const auto bytes = ros::encode(ros::WrenchStamped{{{1, 2}, "world"}, {1, 2, 3}, {4, 5, 6}});
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_TRUE(fails_saying(
        [&] { return ros::decode<ros::WrenchStamped>(std::span(bytes).first(size), "wrench"); },
        "wrench"))
        << size;
  }
}

}  // namespace test_cdr
}  // namespace palpate
