// SPDX-License-Identifier: Apache-2.0
// Bags that others recorded. Those of palpate's own are in tests/record.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/bag/bag_writer.hpp"
#include "palpate/io/bag/messages.hpp"
#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"

#include "tests/sources/damaged_frames.hpp"
#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_recording {

using test::fails_saying;
using test::TemporaryFolder;

constexpr std::int64_t second = 1'000'000'000;
constexpr std::int64_t milli = 1'000'000;
constexpr const char* depth_topic = "/camera/depth/image_rect_raw";
constexpr const char* info_topic = "/camera/depth/camera_info";

ros::Header header_at(std::int64_t nanoseconds) {
  return {ros::Time::at(nanoseconds), "camera_depth_optical_frame"};
}

ros::CameraInfo info_of(std::uint32_t width, std::uint32_t height) {
  return {.header = header_at(100 * second),
          .height = height,
          .width = width,
          .distortion_model = "plumb_bob",
          .d = {0, 0, 0, 0, 0},
          .k = {50, 0, 1.5, 0, 51, 1, 0, 0, 1},
          .p = {40, 0, 1.5, 0, 0, 41, 1, 0, 0, 0, 1, 0}};
}

// The values row by row, each row followed by `padding` bytes that mean nothing.
template <class T>
std::vector<std::byte> pixels(const std::vector<T>& values, std::size_t width, std::size_t padding,
                              bool big_endian = false) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i < values.size(); ++i) {
    auto value = std::bit_cast<std::array<std::byte, sizeof(T)>>(values[i]);
    if (big_endian) std::reverse(value.begin(), value.end());
    bytes.insert(bytes.end(), value.begin(), value.end());
    if ((i + 1) % width == 0) bytes.insert(bytes.end(), padding, std::byte{0xee});
  }
  return bytes;
}

ros::Image image_16uc1(std::int64_t at, const std::vector<std::uint16_t>& depth) {
  return {.header = header_at(at),
          .height = 3,
          .width = 4,
          .encoding = "16UC1",
          .step = 8,
          .data = pixels(depth, 4, 0)};
}

class ForeignBag : public ::testing::Test {
 protected:
  template <class Message>
  void write(const std::string& topic, std::int64_t at, const Message& message) {
    writer().write(writer().topic(topic, Message::type), at, ros::encode(message));
  }
  BagWriter& writer() {
    if (!writer_) writer_ = std::make_unique<BagWriter>(folder_.path() / "bag");
    return *writer_;
  }
  std::unique_ptr<Source> open(const std::string& options = "") {
    writer().close();
    return open_source("recording:" + (folder_.path() / "bag").string() + options);
  }
  // The only depth image of a bag of one.
  std::vector<std::uint16_t> depth_of(const std::string& options = "") {
    const auto frame = open(options)->next();
    return dynamic_cast<const DepthImage&>(*frame->cloud).depth().copy();
  }

  TemporaryFolder folder_;
  std::unique_ptr<BagWriter> writer_;
  std::vector<std::uint16_t> depth_{0, 1, 2, 65535, 500, 600, 700, 800, 900, 1000, 1100, 1200};
};

TEST_F(ForeignBag, OfDepthInMillimetresIsReadByItsCameraInfo) {
  write(info_topic, 100 * second, info_of(4, 3));
  for (int i = 0; i < 3; ++i)
    write(depth_topic, 200 * second + i, image_16uc1(100 * second + i * second / 4, depth_));
  const auto source = open();
  EXPECT_EQ(source->info().kind, "ROS 2 bag");
  EXPECT_EQ(source->info().frames, 3U);
  EXPECT_EQ(source->info().start_time, 100.0);
  for (int i = 0; i < 3; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->stamp, 0.25 * i);  // by the image's own clock
    const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
    EXPECT_EQ(image.depth().copy(), depth_);
    EXPECT_EQ(image.units_per_metre(), 1000.0);
    // Rectified: by P, not K.
    EXPECT_EQ(image.intrinsics(),
              (Intrinsics{.width = 4, .height = 3, .fx = 40, .fy = 41, .cx = 1.5, .cy = 1}));
  }
  EXPECT_FALSE(source->next());
  EXPECT_EQ(source->info().details, "16UC1");
}

TEST_F(ForeignBag, OfBigEndianRowsWithPaddingIsRead) {
  ros::Image image = image_16uc1(100 * second, {});
  image.is_bigendian = 1;
  image.step = 11;
  image.data = pixels(depth_, 4, 3, true);
  write(info_topic, 0, info_of(4, 3));
  write(depth_topic, 0, image);
  EXPECT_EQ(depth_of(), depth_);
}

TEST_F(ForeignBag, OfDepthInFloatsIsRoundedAndWhatIsNoDepthBecomesAHole) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinite = std::numeric_limits<float>::infinity();
  const std::vector<float> metres{nan,  infinite, -infinite, 0.0F,  -1.0F, 13.2F,
                                  0.5F, 1.0F,     2.00014F,  13.0F, 1e-5F, 1e30F};
  ros::Image image = image_16uc1(100 * second, {});
  image.encoding = "32FC1";
  image.step = 16;
  image.data = pixels(metres, 4, 0);
  write(info_topic, 0, info_of(4, 3));
  write(depth_topic, 0, image);
  EXPECT_EQ(depth_of(),
            (std::vector<std::uint16_t>{0, 0, 0, 0, 0, 0, 2500, 5000, 10001, 65000, 0, 0}));
  EXPECT_EQ(depth_of("?units=1000"),
            (std::vector<std::uint16_t>{0, 0, 0, 0, 0, 13200, 500, 1000, 2000, 13000, 0, 0}));
}

TEST_F(ForeignBag, OfCompressedDepthIsUnpacked) {
  ros::CompressedImage packed{
      .header = header_at(100 * second), .format = "16UC1; compressedDepth", .data = {}};
  const auto png = encode_depth_png(4, 3, depth_);
  packed.data.resize(12);
  packed.data.insert(packed.data.end(), png.begin(), png.end());
  write(info_topic, 0, info_of(4, 3));
  write("/camera/depth/image_raw/compressedDepth", 0, packed);
  EXPECT_EQ(depth_of(), depth_);
}

// Inverse depth: raw = a / depth + b.
TEST_F(ForeignBag, OfCompressedDepthInFloatsIsUnpacked) {
  const float a = 10000.0F;
  const float b = 100.0F;
  ros::CompressedImage packed{
      .header = header_at(100 * second), .format = "32FC1; compressedDepth png", .data = {}};
  const std::vector<std::uint16_t> inverse{0,    10100, 5100, 20100, 1100, 1100,
                                           1100, 1100,  1100, 1100,  1100, 1100};
  packed.data.resize(12);
  std::memcpy(packed.data.data() + 4, &a, 4);
  std::memcpy(packed.data.data() + 8, &b, 4);
  const auto png = encode_depth_png(4, 3, inverse);
  packed.data.insert(packed.data.end(), png.begin(), png.end());
  write(info_topic, 0, info_of(4, 3));
  write("/camera/depth/image_raw/compressedDepth", 0, packed);
  const auto frame = open()->next();
  const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
  EXPECT_EQ(image.units_per_metre(), 5000.0);
  EXPECT_EQ((std::vector<std::uint16_t>(image.depth().begin(), image.depth().begin() + 5)),
            (std::vector<std::uint16_t>{0, 5000, 10000, 2500, 50000}));
}

TEST_F(ForeignBag, OfPointsIsReadWhereverItsFieldsLie) {
  ros::PointCloud2 cloud{.header = header_at(100 * second),
                         .width = 3,
                         .fields = {{"intensity", 0, 4}, {"z", 2, 7}, {"x", 6, 8}, {"y", 14, 7}},
                         .point_step = 26,
                         .row_step = 78,
                         .data = std::vector<std::byte>(78)};
  for (std::size_t i = 0; i < 3; ++i) {
    const float z = i == 1 ? std::numeric_limits<float>::quiet_NaN() : 0.5F;
    const double x = 0.1 * static_cast<double>(i);
    const float y = -0.25F;
    std::memcpy(cloud.data.data() + 26 * i + 2, &z, 4);
    std::memcpy(cloud.data.data() + 26 * i + 6, &x, 8);
    std::memcpy(cloud.data.data() + 26 * i + 14, &y, 4);
  }
  write("/lidar", 0, cloud);
  const auto frame = open()->next();
  const auto& points = dynamic_cast<const PointCloud&>(*frame->cloud);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points.non_finite(), 1U);
  EXPECT_EQ(points.point(0), Vec3(0.0, -0.25, 0.5));
  EXPECT_EQ(points.point(1), Vec3(0.2, -0.25, 0.5));
}

TEST_F(ForeignBag, OfOrganisedPointsIsTheDepthImageOfTheirCamera) {
  constexpr std::uint32_t width = 40, height = 30;
  ros::PointCloud2 cloud{.header = header_at(100 * second),
                         .height = height,
                         .width = width,
                         .fields = {{"x", 0, 7}, {"y", 4, 7}, {"z", 8, 7}},
                         .point_step = 16,
                         .row_step = 16 * width,
                         .data = std::vector<std::byte>(16 * width * height)};
  for (std::uint32_t i = 0; i < width * height; ++i) {
    const float u = static_cast<float>(i % width), v = static_cast<float>(i / width);
    const float z = 0.8F + 0.1F * std::sin(0.3F * u);
    const std::array point = {(u - 20.0F) / 35.0F * z, (v - 15.0F) / 35.0F * z, z};
    std::memcpy(cloud.data.data() + 16 * i, point.data(), sizeof point);
  }
  write("/camera/points", 0, cloud);
  const auto frame = open()->next();
  const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
  EXPECT_NEAR(image.intrinsics().fx, 35.0, 1e-3);
  const double z = 0.8 + 0.1 * std::sin(0.3 * 25);
  const Vec3 point(5.0 / 35.0 * z, -12.0 / 35.0 * z, z);
  EXPECT_LT((image.deproject(25, 3).value() - point).norm(), 1e-4);
}

// Pixel i is of red i, green 2 i, blue 3 i.
ros::Image colours(std::int64_t at, const std::string& frame, const std::string& encoding) {
  std::vector<std::byte> bytes;
  for (int i = 0; i < 6; ++i) {
    std::array<int, 4> channels{i, 2 * i, 3 * i, 255};
    if (encoding.starts_with("bgr")) std::swap(channels[0], channels[2]);
    for (std::size_t c = 0; c + 1 < encoding.size(); ++c)
      bytes.push_back(static_cast<std::byte>(channels[c]));
    if (i % 3 == 2) bytes.push_back(std::byte{0xee});  // padding
  }
  return {.header = {ros::Time::at(at), frame},
          .height = 2,
          .width = 3,
          .encoding = encoding,
          .step = static_cast<std::uint32_t>(3 * (encoding.size() - 1) + 1),
          .data = bytes};
}

const std::vector<std::uint8_t> six_colours{0, 0, 0, 1, 2, 3,  2, 4,  6,
                                            3, 6, 9, 4, 8, 12, 5, 10, 15};
constexpr const char* colour_topic = "/camera/color/image_raw";
constexpr const char* colour_info = "/camera/color/camera_info";

TEST_F(ForeignBag, GivesTheColourImageNearestInTime) {
  write(info_topic, 0, info_of(4, 3));
  write(colour_info, 0, info_of(3, 2));
  write("/camera/infra/rgb_unlike", 0,
        colours(0, "elsewhere", "rgb8"));  // no CameraInfo, farther off
  for (const std::int64_t at : {0, 100, 400})
    write(depth_topic, at * milli, image_16uc1(at, depth_));
  write(colour_topic, 90 * milli, colours(0, "/camera_depth_optical_frame", "bgra8"));
  write(colour_topic, 250 * milli, image_16uc1(0, depth_));
  const auto source = open();
  const auto frame = source->next();
  ASSERT_TRUE(frame && frame->colour);
  EXPECT_EQ(frame->colour->width, 3);
  EXPECT_EQ(frame->colour->height, 2);
  EXPECT_EQ(frame->colour->rgb, six_colours);
  ASSERT_TRUE(frame->colour->camera);
  EXPECT_EQ(frame->colour->camera->intrinsics,
            (Intrinsics{.width = 3, .height = 2, .fx = 50, .fy = 51, .cx = 1.5, .cy = 1}));
  EXPECT_TRUE(frame->colour->camera->world_from_camera.matrix().isIdentity(0.0));
  EXPECT_NE(source->next()->colour, nullptr);
  EXPECT_EQ(source->next()->colour, nullptr) << "none within 0.1 s";
}

TEST_F(ForeignBag, SaysWhyItsColourIsLeftOut) {
  write(info_topic, 0, info_of(4, 3));
  write(depth_topic, 0, image_16uc1(0, depth_));
  write(colour_topic, 0, colours(0, "camera_color_optical_frame", "rgb8"));
  write(colour_info, 0, info_of(3, 2));
  const auto source = open();
  EXPECT_EQ(source->next()->colour, nullptr);
  ASSERT_EQ(source->info().notes.size(), 2U);
  EXPECT_NE(source->info().notes[1].find("colour is skipped: topic /camera/color"),
            std::string::npos);
  EXPECT_NE(source->info().notes[1].find("/tf_static"), std::string::npos);
}

TEST_F(ForeignBag, OfPointsGivesTheirColours) {
  for (const std::uint8_t type : {std::uint8_t{6}, std::uint8_t{7}}) {
    ros::PointCloud2 cloud{.header = header_at(0),
                           .width = 2,
                           .fields = {{"x", 0, 7}, {"y", 4, 7}, {"z", 8, 7}, {"rgb", 12, type}},
                           .point_step = 16,
                           .row_step = 32,
                           .data = std::vector<std::byte>(32)};
    for (std::size_t i = 0; i < 2; ++i) {
      const auto packed = static_cast<std::uint32_t>(0xff102030 + i);
      const float x = static_cast<float>(2 - i);
      std::memcpy(cloud.data.data() + 16 * i, &x, 4);
      std::memcpy(cloud.data.data() + 16 * i + 12, &packed, 4);
    }
    write("/points_" + std::to_string(type), 0, cloud);
  }
  for (const char* topic : {"/points_6", "/points_7"}) {
    const auto frame = open("?topic=" + std::string(topic))->next();
    ASSERT_TRUE(frame && frame->colour);
    EXPECT_EQ(frame->colour->rgb, (std::vector<std::uint8_t>{16, 32, 48, 16, 32, 49}));
    const auto& cloud = dynamic_cast<const PointCloud&>(*frame->cloud);
    ASSERT_NE(cloud.surface(), nullptr);
    EXPECT_EQ(cloud.surface()->points[0].x(), 2.0);
  }
}

TEST_F(ForeignBag, OfSeveralCamerasSaysWhichOneItReads) {
  write("/a/depth/camera_info", 0, info_of(4, 3));
  write("/b/depth/camera_info", 0, info_of(4, 3));
  write("/b/depth/image", 0, image_16uc1(0, depth_));
  write("/a/depth/image", 0, image_16uc1(0, depth_));
  write("/a/color/image", 0, image_16uc1(0, depth_));
  const auto source = open();
  ASSERT_EQ(source->info().notes.size(), 3U) << "the last of them of a colour without its lens";
  EXPECT_EQ(source->info().notes[0],
            "/a/depth/image is read; also there, by ?topic=: /b/depth/image");
  EXPECT_EQ(source->info().notes[1],
            "the bag has no TF (/tf, /tf_static): points are in the camera frame");
  EXPECT_EQ(open("?topic=/b/depth/image")->info().notes.size(), 2U);
}

TEST_F(ForeignBag, ThatCannotBeTouchedIsRefusedWithTheReason) {
  write("/text", 0, ros::String{"hello"});
  write("/alone/depth/image", 0, image_16uc1(0, depth_));
  EXPECT_TRUE(fails_saying([&] { return open(); }, "/alone/depth/image", "no CameraInfo",
                           "/alone/depth/camera_info"));
  EXPECT_TRUE(fails_saying([&] { return open("?topic=/text"); }, "/text", "std_msgs/msg/String"));
  EXPECT_TRUE(fails_saying([&] { return open("?topic=/none"); }, "/none", "not in the bag"));
  EXPECT_TRUE(fails_saying([&] { return open("?topics=/none"); }, "topics", "topic"));
}

TEST_F(ForeignBag, WithoutDepthIsRefused) {
  write("/text", 0, ros::String{"hello"});
  EXPECT_TRUE(fails_saying([&] { return open(); }, "no topic of depth"));
}

TEST_F(ForeignBag, WithABadFrameGoesOnBehindIt) {
  write(info_topic, 0, info_of(4, 3));
  write(depth_topic, 0, image_16uc1(100 * second, depth_));
  ros::Image colour = image_16uc1(101 * second, depth_);
  colour.encoding = "rgb8";
  ros::Image cut = image_16uc1(102 * second, depth_);
  cut.data.resize(23);
  ros::Image narrow = image_16uc1(103 * second, depth_);
  narrow.step = 7;
  ros::Image other = image_16uc1(104 * second, depth_);
  other.height = 2;
  ros::Image empty = image_16uc1(105 * second, depth_);
  empty.height = 0;
  for (const ros::Image& image : {colour, cut, narrow, other, empty}) write(depth_topic, 0, image);
  write(depth_topic, 0, image_16uc1(106 * second, depth_));
  const auto source = open();
  EXPECT_TRUE(source->next());
  const auto next = [&] { return source->next(); };
  EXPECT_TRUE(fails_saying(next, "rgb8", "message 2 of /camera/depth"));
  EXPECT_TRUE(fails_saying(next, "23 bytes"));
  EXPECT_TRUE(fails_saying(next, "do not fit"));
  EXPECT_TRUE(fails_saying(next, "4x3", "4x2"));
  EXPECT_TRUE(fails_saying(next, "4x0"));
  const auto last = source->next();
  ASSERT_TRUE(last);
  EXPECT_EQ(last->stamp, 6.0);
}

TEST_F(ForeignBag, OfAFisheyeIsRefused) {
  ros::CameraInfo info = info_of(4, 3);
  info.distortion_model = "equidistant";
  info.d = {0.1, 0, 0, 0};
  write("/camera/depth/camera_info", 0, info);
  write("/camera/depth/image_raw", 0, image_16uc1(0, depth_));
  EXPECT_TRUE(fails_saying([&] { return open(); }, "equidistant"));
}

TEST_F(ForeignBag, WithDamagedMessagesIsReadOrAnErrorOfOneLine) {
  std::mt19937 random(5);
  const ros::PointCloud2 cloud{.header = header_at(0),
                               .width = 2,
                               .fields = {{"x", 0, 7}, {"y", 4, 7}, {"z", 8, 7}},
                               .point_step = 12,
                               .row_step = 24,
                               .data = std::vector<std::byte>(24)};
  const auto damaged = [&](std::vector<std::byte> bytes) {
    for (auto changes = random() % 4; changes > 0; --changes)
      bytes[random() % bytes.size()] = static_cast<std::byte>(random());
    if (random() % 4 == 0) bytes.resize(random() % bytes.size());
    return bytes;
  };
  write(info_topic, 0, info_of(4, 3));
  const std::size_t images = writer().topic(depth_topic, ros::Image::type);
  const std::size_t clouds = writer().topic("/points", ros::PointCloud2::type);
  write(depth_topic, 0, image_16uc1(0, depth_));
  write("/points", 0, cloud);
  for (int i = 0; i < 3000; ++i) {
    writer().write(images, i, damaged(ros::encode(image_16uc1(0, depth_))));
    writer().write(clouds, i, damaged(ros::encode(cloud)));
  }
  int errors = 0;
  for (const char* topic : {depth_topic, "/points"})
    errors += test::damaged_frames(*open("?topic=" + std::string(topic)));
  EXPECT_GT(errors, 100);
}

// A base that drives along y from 0.1 to 0.5 s and turns left meanwhile, by 1 m and 90 degrees in
// half a second from 0; its camera looks ahead from a height of 1 m.
class BagWithTransforms : public ForeignBag {
 protected:
  static ros::TransformStamped transform(const std::string& parent, const std::string& child,
                                         double stamp, const Eigen::Vector3d& t,
                                         const Eigen::Quaterniond& q) {
    return {
        .header = {ros::Time::at(100 * second + static_cast<std::int64_t>(stamp * 1e9)), parent},
        .child_frame_id = child,
        .translation = {t.x(), t.y(), t.z()},
        .rotation = {q.x(), q.y(), q.z(), q.w()}};
  }
  // The base's pose, by what was said above.
  static Eigen::Isometry3d base(double stamp) {
    Eigen::Isometry3d pose(Eigen::AngleAxisd(stamp * std::numbers::pi, Eigen::Vector3d::UnitZ()));
    pose.translation() = Eigen::Vector3d(5.0, 2.0 * stamp, 0.0);
    return pose;
  }
  // x of the camera to the right, y down, z ahead; ahead is the base's x.
  static Eigen::Quaterniond mount() {
    Eigen::Matrix3d rotation;
    rotation << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    return Eigen::Quaterniond(rotation);
  }
  void write_tf(std::initializer_list<double> stamps) {
    write("/tf_static", 0,
          ros::TFMessage{{transform("base_link", "camera_depth_optical_frame", 0.0,
                                    Eigen::Vector3d(0.0, 0.0, 1.0), mount())}});
    for (const double stamp : stamps) {
      const Eigen::Isometry3d pose = base(stamp);
      Eigen::Quaterniond rotation(pose.linear());
      if (stamp > 0.2) rotation.coeffs() *= -1.0;  // the same rotation
      write("/tf", 0,
            ros::TFMessage{{transform("odom", "/base_link", stamp, pose.translation(), rotation),
                            transform("elsewhere", "arm", stamp, pose.translation(), rotation)}});
    }
  }
  void write_frames(std::initializer_list<double> stamps) {
    write(info_topic, 0, info_of(4, 3));
    for (const double stamp : stamps)
      write(depth_topic, 0,
            image_16uc1(100 * second + static_cast<std::int64_t>(stamp * 1e9), depth_));
  }
};

TEST_F(BagWithTransforms, GivesTheCamerasPoseBetweenThem) {
  write_tf({0.5, 0.1});
  write_frames({0.2, 0.3});
  const auto source = open();
  ASSERT_EQ(source->info().notes.size(), 1U);
  EXPECT_NE(source->info().notes[0].find("in odom"), std::string::npos);
  for (const double stamp : {0.2, 0.3}) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    Eigen::Isometry3d camera(mount());
    camera.translation() = Eigen::Vector3d(0.0, 0.0, 1.0);
    const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
    EXPECT_LT((image.world_from_camera().matrix() - (base(stamp) * camera).matrix()).norm(), 1e-6);
    EXPECT_NEAR(frame->stamp, stamp - 0.2, 1e-6);
  }
}

TEST_F(BagWithTransforms, SayWhereTheColourCameraStands) {
  write_tf({0.1, 0.5});
  write_frames({0.2});
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()));
  const Eigen::Vector3d beside(0.015, 0.0, 0.001);
  write("/tf_static", 0,
        ros::TFMessage{{transform("camera_depth_optical_frame", "colour", 0.0, beside, turned)}});
  write(colour_info, 0, info_of(3, 2));
  write(colour_topic, 0, colours(0, "colour", "rgb8"));
  Eigen::Isometry3d depth_from_colour(turned);
  depth_from_colour.translation() = beside;
  // In odom, and where nothing leads there.
  for (const char* options : {"", "?fixed_frame=base_link"}) {
    const auto frame = open(options)->next();
    ASSERT_TRUE(frame && frame->colour && frame->colour->camera);
    const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
    const Eigen::Isometry3d wanted = image.world_from_camera() * depth_from_colour;
    EXPECT_LT((frame->colour->camera->world_from_camera.matrix() - wanted.matrix()).norm(), 1e-9);
  }
}

TEST_F(BagWithTransforms, LeavesFramesOutThatTheyDoNotCover) {
  write_tf({0.1, 0.2, 2.0, 2.1});
  write_frames({0.0, 0.15, 0.5, 2.05, 3.0});
  const auto source = open();
  for (const double stamp : {0.15, 2.05}) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_NEAR(frame->stamp, stamp - 0.15, 1e-6);
  }
  EXPECT_FALSE(source->next());
  const auto all = open("?fixed_frame=none");
  for (int i = 0; i < 5; ++i) {
    const auto frame = all->next();
    ASSERT_TRUE(frame);
    EXPECT_TRUE(dynamic_cast<const DepthImage&>(*frame->cloud)
                    .world_from_camera()
                    .isApprox(Eigen::Isometry3d::Identity()));
  }
}

TEST_F(BagWithTransforms, TakesTheFixedFrameThatIsNamed) {
  write_tf({0.1, 0.5});
  write_frames({0.2});
  const auto frame = open("?fixed_frame=base_link")->next();
  ASSERT_TRUE(frame);
  const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
  EXPECT_LT((image.world_from_camera().translation() - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  EXPECT_TRUE(fails_saying([&] { return open("?fixed_frame=elsewhere"); }, "elsewhere",
                           "camera_depth_optical_frame", "odom"));
}

TEST_F(BagWithTransforms, SaysWhereNoFixedFrameLeadsToTheCamera) {
  write_tf({});
  write_frames({0.2});
  write("/tf_static", 0,
        ros::TFMessage{{transform("camera_depth_optical_frame", "colour", 0.0,
                                  Eigen::Vector3d(1, 2, 3), Eigen::Quaterniond::Identity())}});
  write(colour_info, 0, info_of(3, 2));
  write(colour_topic, 0, colours(0, "colour", "rgb8"));
  const auto source = open();
  ASSERT_EQ(source->info().notes.size(), 1U);
  EXPECT_NE(source->info().notes[0].find("?fixed_frame=base_link"), std::string::npos);
  const auto frame = source->next();
  ASSERT_NE(frame->colour, nullptr) << "its camera is beside the depth's, wherever that is";
  EXPECT_LT((frame->colour->camera->world_from_camera.translation() - Vec3(1, 2, 3)).norm(), 1e-9);
  EXPECT_TRUE(dynamic_cast<const DepthImage&>(*frame->cloud)
                  .world_from_camera()
                  .isApprox(Eigen::Isometry3d::Identity()));
}

TEST_F(BagWithTransforms, ThatHasNoneForAnyFrameOrDamagedOnesIsRefused) {
  write_tf({0.1, 0.2});
  write_frames({5.0});
  EXPECT_TRUE(fails_saying([&] { return open(); }, "any frame", "fixed_frame=none"));
  EXPECT_TRUE(open("?fixed_frame=none")->next());
}

TEST_F(BagWithTransforms, MovesPointsToo) {
  write_tf({0.0, 0.5});
  ros::PointCloud2 cloud{.header = header_at(100 * second + second / 4),
                         .width = 1,
                         .fields = {{"x", 0, 7}, {"y", 4, 7}, {"z", 8, 7}},
                         .point_step = 12,
                         .row_step = 12,
                         .data = std::vector<std::byte>(12)};
  const float ahead = 2.0F;
  std::memcpy(cloud.data.data() + 8, &ahead, 4);
  write("/points", 0, cloud);
  const auto frame = open()->next();
  ASSERT_TRUE(frame);
  // The base is at (5, 0.5) then, turned by 45 degrees.
  const Vec3 point = dynamic_cast<const PointCloud&>(*frame->cloud).point(0);
  EXPECT_LT((point - Vec3(5.0 + std::sqrt(2.0), 0.5 + std::sqrt(2.0), 1.0)).norm(), 1e-6);
}

// One message of a real LiDAR, as ROS 2 put it on the wire.
TEST_F(ForeignBag, OfARealLidarIsRead) {
  PALPATE_DATA_OR_SKIP(file, "formats/rosbag2/cloudini__dds_message.bin");
  std::vector<std::byte> bytes(std::filesystem::file_size(file));
  std::FILE* in = std::fopen(file.c_str(), "rb");
  ASSERT_EQ(std::fread(bytes.data(), 1, bytes.size(), in), bytes.size());
  std::fclose(in);
  writer().write(writer().topic("/points", ros::PointCloud2::type), 0, bytes);
  const auto frame = open()->next();
  const auto& points = dynamic_cast<const PointCloud&>(*frame->cloud);
  EXPECT_EQ(points.size() + points.non_finite(), 64000U);
  EXPECT_LT(points.point(0).norm(), 300.0);
}

}  // namespace test_recording
}  // namespace palpate
