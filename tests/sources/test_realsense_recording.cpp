// SPDX-License-Identifier: Apache-2.0
// Recordings in librealsense's layouts, written here from its public sources and from what others
// read of them; of the newer one no file of a real camera was at hand.
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/realsense_lens.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

#include "tests/sources/damaged_frames.hpp"
#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/realsense_recording.hpp"
#include "tests/support/ros1_bag.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_realsense_recording {

using test::fails_saying;
using test::RealSenseRecording;
using test::TemporaryFolder;

constexpr std::int64_t milliseconds = 1'000'000;
constexpr const char* lens =
    "width=4;height=3;fx=50.5;ppx=1.25;fy=51;ppy=1.5;model=Brown Conrady;"
    "coeffs=0.000000,0.000000,0.000000,0.000000,0.000000";

class RealSenseFile : public ::testing::Test {
 protected:
  [[nodiscard]] RealSenseRecording create(bool compressed = true) const {
    return {file_, compressed};
  }
  [[nodiscard]] std::unique_ptr<Source> open(const std::string& options = "") const {
    return open_source("recording:" + file_.string() + options);
  }

  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "room.db3";
  std::vector<std::uint16_t> depth_{0, 1, 2, 65535, 500, 600, 700, 800, 900, 1000, 1100, 1200};
};

class RealSenseFileOfEitherKind : public RealSenseFile,
                                  public ::testing::WithParamInterface<bool> {};

TEST_P(RealSenseFileOfEitherKind, IsReadWithItsLensUnitAndStamps) {
  {
    auto recording = create(GetParam());
    recording.describe(lens, "0.000100", "RealSense D405");
    const std::string colour = "/device_0/sensor_1/Color_0/image/data";
    for (int i = 0; i < 3; ++i) {
      recording.image((1000 + 33 * i) * milliseconds, 4, 3, depth_);
      recording.text("/device_0/sensor_0/Depth_0/image/metadata", (1000 + 33 * i) * milliseconds,
                     "Frame number=7;timestamp_domain=Global Time;");
      recording.image((1000 + 33 * i) * milliseconds, 4, 3, depth_, colour);
    }
  }
  const auto source = open();
  EXPECT_EQ(source->info().kind, "RealSense recording");
  EXPECT_EQ(source->info().sensor, SensorKind::stereo);
  EXPECT_EQ(source->info().frames, 3U);
  EXPECT_NEAR(*source->info().frame_rate, 30.3, 0.01);
  ASSERT_EQ(source->info().notes.size(), 1U) << "colour and infrared are no depth";
  EXPECT_TRUE(source->info().notes[0].starts_with("colour is skipped: "));
  for (int i = 0; i < 3; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_NEAR(frame->stamp, 0.033 * i, 1e-9);
    const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
    EXPECT_EQ(image.depth().copy(), depth_);
    EXPECT_DOUBLE_EQ(image.units_per_metre(), 10'000.0);
    EXPECT_EQ(image.intrinsics(),
              (Intrinsics{.width = 4, .height = 3, .fx = 50.5, .fy = 51, .cx = 1.25, .cy = 1.5}));
  }
  EXPECT_FALSE(source->next());
}
INSTANTIATE_TEST_SUITE_P(Compressed, RealSenseFileOfEitherKind, ::testing::Bool());

TEST_F(RealSenseFile, WhoseUnitChangesIsReadByTheUnitOfTheTime) {
  {
    auto recording = create();
    recording.describe(lens, "0.001000");
    recording.image(1000 * milliseconds, 4, 3, depth_);
    recording.text(RealSenseRecording::units_topic, 1010 * milliseconds, "0.000250");
    recording.image(1033 * milliseconds, 4, 3, depth_);
  }
  const auto units = [](const Frame& frame) {
    return dynamic_cast<const DepthImage&>(*frame.cloud).units_per_metre();
  };
  const auto source = open();
  EXPECT_DOUBLE_EQ(units(*source->next()), 1000.0);
  EXPECT_DOUBLE_EQ(units(*source->next()), 4000.0);
  EXPECT_DOUBLE_EQ(units(*open("?units=2000")->next()), 2000.0);
}

TEST_F(RealSenseFile, GivesItsColourFromWhereThatCameraStands) {
  const std::string colour = "/device_0/sensor_1/Color_0";
  {
    auto recording = create();
    recording.describe(lens, "0.001000");
    recording.image(1000 * milliseconds, 4, 3, depth_);
    recording.text(colour + "/camera_info", 0,
                   "width=1;height=1;fx=9;ppx=0.5;fy=8;ppy=0.25;model=Inverse Brown Conrady;"
                   "coeffs=0.1,0,0,0,0");
    recording.write(colour + "/image/data", ros::Image::type, 1010 * milliseconds,
                    ros::encode(ros::Image{.header = {},
                                           .height = 1,
                                           .width = 1,
                                           .encoding = "rgb8",
                                           .step = 3,
                                           .data = std::vector<std::byte>(3, std::byte{7})}));
    // From the device's first stream: a point before the depth camera is 15 mm more to the right
    // before the colour camera, which is the first's left neighbour.
    recording.write("/device_0/sensor_0/Depth_0/tf/0", ros::Transform::type, 0,
                    ros::encode(ros::Transform{.translation = {0.05, 0, 0}}));
    recording.write(colour + "/tf/0", ros::Transform::type, 0,
                    ros::encode(ros::Transform{.translation = {0.065, 0, 0}}));
  }
  const auto frame = open()->next();
  ASSERT_TRUE(frame && frame->colour && frame->colour->camera);
  EXPECT_EQ(frame->colour->rgb, (std::vector<std::uint8_t>{7, 7, 7}));
  EXPECT_EQ(frame->colour->camera->intrinsics,
            (Intrinsics{.width = 1, .height = 1, .fx = 9, .fy = 8, .cx = 0.5, .cy = 0.25}));
  EXPECT_TRUE(frame->colour->camera->world_from_camera.translation().isApprox(
      Eigen::Vector3d(-0.015, 0, 0), 1e-12));
}

TEST_F(RealSenseFile, WithoutAUnitAsksForIt) {
  {
    auto recording = create();
    recording.describe(lens, "");
    recording.image(0, 4, 3, depth_);
  }
  EXPECT_TRUE(fails_saying([&] { return open(); }, "Depth_Units", "?units="));
  EXPECT_TRUE(open("?units=1000")->next());
}

TEST_F(RealSenseFile, WithAUnitThatCannotBeIsRefused) {
  for (const char* unit : {"0", "-0.001", "nan", "1000", "one"}) {
    std::filesystem::remove(file_);
    {
      auto recording = create();
      recording.describe(lens, unit);
      recording.image(0, 4, 3, depth_);
    }
    EXPECT_TRUE(fails_saying([&] { return open(); }, unit, "Depth_Units", "?units="));
  }
}

TEST_F(RealSenseFile, OfSeveralSensorsSaysWhichOneItReads) {
  {
    auto recording = create();
    recording.describe(lens, "0.001000");
    const std::string other = "/device_1/sensor_0/Depth_0/";
    recording.text(other + "camera_info", 0, lens);
    recording.text("/device_1/sensor_0/option/Depth_Units/value", 0, "0.000250");
    recording.text("/device_1/info", 0, "Name=Intel RealSense L515;");
    recording.image(0, 4, 3, depth_);
    recording.image(0, 4, 3, depth_, other + "image/data");
    recording.image(0, 4, 3, depth_, "/device_0/sensor_0/Infrared_1/image/data");
  }
  EXPECT_EQ(open()->info().notes,
            std::vector<std::string>{"/device_0/sensor_0/Depth_0/image/data is read; also there, "
                                     "by ?topic=: /device_1/sensor_0/Depth_0/image/data"});
  const auto second = open("?topic=/device_1/sensor_0/Depth_0/image/data");
  EXPECT_EQ(second->info().sensor, SensorKind::time_of_flight);
  EXPECT_DOUBLE_EQ(dynamic_cast<const DepthImage&>(*second->next()->cloud).units_per_metre(),
                   4000.0);
}

TEST_F(RealSenseFile, WithoutItsLensIsRefused) {
  {
    auto recording = create();
    recording.describe("", "0.001000");
    recording.image(0, 4, 3, depth_);
  }
  EXPECT_TRUE(fails_saying([&] { return open(); }, "camera_info"));
}

TEST_F(RealSenseFile, OfAnotherSizeThanItsLensIsRefused) {
  {
    auto recording = create();
    recording.describe(lens, "0.001000");
    recording.image(0, 6, 2, depth_);
  }
  EXPECT_TRUE(fails_saying([&] { return open(); }, "6x2", "4x3"));
}

TEST_F(RealSenseFile, WithDamagedMessagesIsReadOrAnErrorOfOneLine) {
  std::mt19937 random(7);
  const auto image = ros::encode(ros::Image{.header = {},
                                            .height = 3,
                                            .width = 4,
                                            .encoding = "mono16",
                                            .step = 8,
                                            .data = std::vector<std::byte>(24, std::byte{4})});
  std::vector<std::byte> packed(ZSTD_compressBound(image.size()));
  packed.resize(ZSTD_compress(packed.data(), packed.size(), image.data(), image.size(), 1));
  {
    auto recording = create();
    recording.describe(lens, "0.001000");
    recording.image(0, 4, 3, depth_);
    for (int i = 1; i < 500; ++i) {
      auto damaged = packed;
      damaged[random() % damaged.size()] ^= static_cast<std::byte>(1U << random() % 8);
      if (i % 4 == 0) damaged.resize(random() % damaged.size());
      recording.write_raw(RealSenseRecording::depth_topic, ros::Image::type, i, damaged);
    }
  }
  EXPECT_GT(test::damaged_frames(*open()), 100);
}

// As librealsense recorded before 2.58.
std::string ros1_bag(const std::string& model, const std::vector<double>& coeffs, float unit,
                     const std::vector<std::uint16_t>& depth, std::uint32_t width = 4) {
  namespace ros1 = test::ros1;
  test::Ros1BagWriter writer("lz4");
  const std::string sensor = "/device_0/sensor_0/";
  writer.message("/device_0/info", "diagnostic_msgs/KeyValue", 1,
                 ros1::text("Physical Port") + ros1::text("usb/L515"));
  writer.message("/device_0/info", "diagnostic_msgs/KeyValue", 1,
                 ros1::text("Name") + ros1::text("Intel RealSense SR300"));
  writer.message(sensor + "Depth_0/info/camera_info", "sensor_msgs/CameraInfo", 1,
                 ros1::camera_info(width, 3, 50.5, 1.25, 1.5, model, coeffs));
  if (unit != 0.0F)
    writer.message(sensor + "option/Depth Units/value", "std_msgs/Float32", 1, ros1::number(unit));
  writer.end_chunk();
  for (int i = 0; i < 3; ++i)
    writer.message(sensor + "Depth_0/image/data", "sensor_msgs/Image", 1 + 33 * i * milliseconds,
                   ros1::image((1000 + 33 * i) * milliseconds, 4, 3, depth, "mono16"));
  writer.message("/device_0/sensor_1/Color_0/image/data", "sensor_msgs/Image", 1,
                 ros1::image(1000, 4, 3, depth, "rgb8"));
  return writer.close();
}

TEST_F(RealSenseFile, OfRos1IsReadWithItsLensUnitAndStamps) {
  const auto file =
      folder_.write("room.bag", ros1_bag("Brown Conrady", {0.1, 0, 0, 0, 0}, 0.0001F, depth_));
  const auto source = open_source("recording:" + file.string());
  EXPECT_EQ(source->info().kind, "RealSense recording");
  EXPECT_EQ(source->info().sensor, SensorKind::structured_light);
  EXPECT_EQ(source->info().frames, 3U);
  ASSERT_EQ(source->info().notes.size(), 1U);
  EXPECT_NE(source->info().notes[0].find("no CameraInfo"), std::string::npos);
  for (int i = 0; i < 3; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_NEAR(frame->stamp, 0.033 * i, 1e-9);
    const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
    EXPECT_EQ(image.depth().copy(), depth_);
    EXPECT_DOUBLE_EQ(image.units_per_metre(), 10'000.0);
    Intrinsics k{.width = 4, .height = 3, .fx = 50.5, .fy = 50.5, .cx = 1.25, .cy = 1.5};
    k.distortion[0] = 0.1;
    EXPECT_EQ(image.intrinsics(), k);
  }
  EXPECT_FALSE(source->next());
}

TEST_F(RealSenseFile, OfRos1ThatCannotBeTouchedIsRefusedWithTheReason) {
  const auto refused = [&](const std::string& bag, const char* first, const char* second) {
    const auto file = folder_.write("room.bag", bag);
    return fails_saying([&] { return open_source("recording:" + file.string()); }, first, second);
  };
  const std::vector<double> none(5);
  EXPECT_TRUE(refused(ros1_bag("None", none, 0.0F, depth_), "Depth Units", "?units="));
  EXPECT_TRUE(refused(ros1_bag("None", none, 7.0F, depth_), "Depth Units", "'7'"));
  EXPECT_TRUE(refused(ros1_bag("None", none, 0.001F, depth_, 5), "4x3", "5x3"));
  EXPECT_TRUE(refused(ros1_bag("Inverse Brown Conrady", {0, 0.1, 0, 0, 0}, 0.001F, depth_),
                      "Inverse Brown", "depth:"));
}

TEST(RealSenseRecorded, InABagOfRos1IsWhatWasTakenOutOfIt) {
  PALPATE_DATA_OR_SKIP(folder, "rec_realsense_bag");
  const auto source =
      open_source("recording:" + (folder / "single_depth_color_640x480.bag").string());
  const auto image =
      open_source("depth:" + (folder / "extracted_depth_000000.png").string())->next();
  const auto frame = source->next();
  ASSERT_TRUE(frame && image);
  const auto& recorded = dynamic_cast<const DepthImage&>(*frame->cloud);
  const auto& extracted = dynamic_cast<const DepthImage&>(*image->cloud);
  EXPECT_EQ(recorded.depth(), extracted.depth());
  EXPECT_EQ(recorded.intrinsics(), extracted.intrinsics());
  EXPECT_EQ(recorded.units_per_metre(), extracted.units_per_metre());
  ASSERT_TRUE(frame->colour && frame->colour->camera);
  EXPECT_EQ(frame->colour->rgb.size(), std::size_t{3} * 640 * 480);
  // The colour camera of a D4xx is some 15 mm to the left of its depth's.
  EXPECT_NEAR(frame->colour->camera->world_from_camera.translation().x(), -0.015, 0.003);
  EXPECT_TRUE(source->next());
  EXPECT_FALSE(source->next());
}

TEST(RealSenseLens, IsReadFromItsText) {
  const RealSenseLens read = parse_realsense_lens(
      "width=848;height=480;fx=422.038;ppx=422.79;fy=423;ppy=236.05;model=Brown Conrady;"
      "coeffs=0.1,-0.2,1e-3,0,5",
      "it");
  EXPECT_EQ(read.pinhole.width, 848);
  EXPECT_EQ(read.pinhole.cy, 236.05);
  EXPECT_EQ(intrinsics_of(read, "it").distortion,
            (std::array<double, 8>{0.1, -0.2, 1e-3, 0, 5, 0, 0, 0}));
}

TEST(RealSenseLens, OfAModelWithoutAnEqualIsRefusedUnlessItIsZero) {
  RealSenseLens inverse{.pinhole = {.width = 4, .height = 3, .fx = 1, .fy = 1},
                        .model = "Inverse Brown Conrady"};
  EXPECT_FALSE(intrinsics_of(inverse, "it").distorted());
  inverse.coeffs[1] = 0.1;
  EXPECT_TRUE(fails_saying([&] { return intrinsics_of(inverse, "it"); }, "it", "Inverse Brown"));
}

TEST(RealSenseLens, RefusesTextsThatAreNone) {
  const auto parse = [](const std::string& text) {
    return [text] { return parse_realsense_lens(text, "it"); };
  };
  const std::string good = lens;
  EXPECT_TRUE(fails_saying(parse(""), "it", "no width"));
  EXPECT_TRUE(fails_saying(parse("width"), "no width"));
  EXPECT_TRUE(fails_saying(parse("width=4;height=x"), "height"));
  EXPECT_TRUE(fails_saying(parse(good.substr(0, good.size() - 9)), "five numbers"));
  EXPECT_TRUE(fails_saying(parse(good.substr(0, good.find("model"))), "model"));
}

}  // namespace test_realsense_recording
}  // namespace palpate
