// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <thread>

#include <gtest/gtest.h>

#include "palpate/drivers/dds.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/ros2.hpp"
#include "palpate/drivers/ros2_publisher.hpp"
#include "palpate/io/sources/depth_png.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/servo/realtime.hpp"

#include "tests/drivers/dds_test.hpp"
#include "tests/support/errors.hpp"

namespace palpate {
namespace test_ros2_camera {

constexpr int width = 8, height = 6;
constexpr double long_enough = 60.0;  // [s]

ros::Header header_at(std::int64_t nanoseconds, const char* frame) {
  return {ros::Time::at(nanoseconds), frame};
}

std::vector<std::uint16_t> a_depth() {
  std::vector<std::uint16_t> depth(std::size_t{width} * height);
  for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = static_cast<std::uint16_t>(500 + 3 * i);
  depth[7] = 0;
  return depth;
}

std::vector<std::uint16_t> depth_of(const DepthImage& image) {
  return {image.depth().begin(), image.depth().end()};
}

template <class T>
std::vector<std::byte> bytes_of(const std::vector<T>& values) {
  const auto bytes = std::as_bytes(std::span(values));
  return {bytes.begin(), bytes.end()};
}

// Somebody who publishes a camera again and again, on a thread of its own, while this lives.
class Publisher {
 public:
  using Round = std::function<void(std::int64_t stamp)>;  // [ns]
  // `make` gets the participant, and gives what is done in each round.
  explicit Publisher(const std::function<Round(dds::Participant&)>& make) {
    thread_ = std::thread([this, make] {
      dds::Participant participant("publisher:");
      const Round round = make(participant);
      for (std::int64_t stamp = 1'000'000'000'000; !ends_; stamp += 10'000'000) {
        round(stamp);
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
      }
    });
  }
  ~Publisher() {
    ends_ = true;
    thread_.join();
  }
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

 private:
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

ros::CameraInfo a_lens(std::int64_t stamp) {
  ros::CameraInfo info;
  info.header = header_at(stamp, "optical");
  info.height = height;
  info.width = width;
  info.k = {10.0, 0.0, 3.5, 0.0, 11.0, 2.5, 0.0, 0.0, 1.0};
  return info;
}

class Ros2Camera : public ::testing::Test {
 protected:
  static std::unique_ptr<Source> open(const std::string& uri) { return open_ros2_camera(Uri(uri)); }
  static Frame frame_of(Source& camera) {
    std::optional<Frame> frame = camera.next(long_enough);
    if (!frame) throw std::runtime_error("no frame came");
    return *frame;
  }
  // Publishes one message of a camera and, if it is an image, its lens.
  template <class Message>
  static Publisher camera(const std::string& topic, const Message& message) {
    return Publisher([topic, message](dds::Participant& participant) {
      const auto depth = std::make_shared<dds::Writer>(participant, topic, message, reliable);
      const auto lens = std::make_shared<dds::Writer>(participant, "/camera/depth/camera_info",
                                                      ros::CameraInfo{}, reliable);
      return [=](std::int64_t stamp) {
        lens->write(a_lens(stamp));
        Message next = message;
        next.header = header_at(stamp, "optical");
        depth->write(next);
      };
    });
  }
  static ros::Image image_of(const std::string& encoding, std::vector<std::byte> data) {
    const auto step = static_cast<std::uint32_t>(data.size() / height);
    return {{}, height, width, encoding, 0, step, std::move(data)};
  }

  static constexpr dds::Quality reliable{.reliable = true};
  test::OwnNetwork network_;
};

TEST_F(Ros2Camera, GivesAnImageWithItsLensAndItsStamp) {
  const Publisher publisher =
      camera("/camera/depth/image_raw", image_of("16UC1", bytes_of(a_depth())));
  const auto source = open("ros2:/camera/depth/image_raw");
  EXPECT_TRUE(source->info().live);
  EXPECT_EQ(source->info().clock, StampClock::system);
  const Frame frame = frame_of(*source);
  const auto& image = dynamic_cast<const DepthImage&>(*frame.cloud);
  EXPECT_EQ(depth_of(image), a_depth());
  EXPECT_EQ(image.units_per_metre(), 1000.0);
  EXPECT_EQ(image.intrinsics().fy, 11.0);
  EXPECT_EQ(image.intrinsics().cx, 3.5);
  EXPECT_GE(frame.stamp, 1000.0);
  EXPECT_TRUE(frame.arrival.has_value());
  EXPECT_GT(frame_of(*source).stamp, frame.stamp);
}

TEST_F(Ros2Camera, GivesMetresAsFloatsAndOtherUnits) {
  std::vector<float> metres(std::size_t{width} * height, 0.5F);
  metres[3] = std::numeric_limits<float>::quiet_NaN();
  const Publisher publisher = camera("/camera/depth/image", image_of("32FC1", bytes_of(metres)));
  const auto source = open("ros2:/camera/depth/image?units=10000");
  const Frame frame = frame_of(*source);
  const auto& image = dynamic_cast<const DepthImage&>(*frame.cloud);
  EXPECT_EQ(image.depth()[2], 5000);
  EXPECT_EQ(image.depth()[3], 0);
}

TEST_F(Ros2Camera, GivesCompressedDepthToTheBit) {
  ros::CompressedImage packed{.header = {}, .format = "16UC1; compressedDepth png", .data = {}};
  packed.data.resize(12);
  const std::vector<std::byte> png = encode_depth_png(width, height, a_depth());
  packed.data.insert(packed.data.end(), png.begin(), png.end());
  const Publisher publisher = camera("/camera/depth/image_raw/compressedDepth", packed);
  const auto source = open("ros2:/camera/depth/image_raw/compressedDepth");
  const Frame frame = frame_of(*source);
  EXPECT_EQ(depth_of(dynamic_cast<const DepthImage&>(*frame.cloud)), a_depth());
}

// Points in rows, or one row of a width that changes from message to message.
TEST_F(Ros2Camera, GivesCloudsOfAnyWidth) {
  const Publisher publisher([](dds::Participant& participant) {
    const auto writer =
        std::make_shared<dds::Writer>(participant, "/camera/points", ros::PointCloud2{}, reliable);
    return [writer, width = 2U](std::int64_t stamp) mutable {
      ros::PointCloud2 cloud;
      cloud.header = header_at(stamp, "optical");
      cloud.width = width;
      cloud.fields = {{"x", 0, 7, 1}, {"y", 4, 7, 1}, {"z", 8, 7, 1}};
      cloud.point_step = 12;
      cloud.row_step = 12 * width;
      cloud.data =
          bytes_of(std::vector<float>(std::size_t{3} * width, 0.25F * static_cast<float>(width)));
      writer->write(cloud);
      width = width == 2 ? 3 : 2;
    };
  });
  const auto source = open("ros2:/camera/points");
  bool two = false;
  bool three = false;
  while (!two || !three) {
    const Frame frame = frame_of(*source);
    const auto& cloud = dynamic_cast<const PointCloud&>(*frame.cloud);
    ASSERT_TRUE(cloud.size() == 2 || cloud.size() == 3);
    (cloud.size() == 2 ? two : three) = true;
    EXPECT_TRUE(cloud.point(1).isApprox(Vec3::Constant(0.25 * static_cast<double>(cloud.size()))));
  }
}

// The camera goes along x at 1 m/s; its lens looks along the world's y.
TEST_F(Ros2Camera, IsWhereTheTransformsSay) {
  const Publisher publisher([](dds::Participant& participant) {
    const auto depth = std::make_shared<dds::Writer>(participant, "/camera/depth/image_raw",
                                                     ros::Image{}, reliable);
    const auto lens = std::make_shared<dds::Writer>(participant, "/camera/depth/camera_info",
                                                    ros::CameraInfo{}, reliable);
    const auto tf = std::make_shared<dds::Writer>(participant, "/tf", ros::TFMessage{}, reliable);
    const auto still =
        std::make_shared<dds::Writer>(participant, "/tf_static", ros::TFMessage{},
                                      dds::Quality{.reliable = true, .keeps_for_late = true});
    const double half = std::sqrt(0.5);
    still->write(ros::TFMessage{
        {{header_at(0, "base"), "optical", {0.0, 0.0, 0.5}, {-half, 0.0, 0.0, half}}}});
    return [=, kept = still](std::int64_t stamp) {
      lens->write(a_lens(stamp));
      ros::Image image = image_of("mono16", bytes_of(a_depth()));
      image.header = header_at(stamp, "optical");
      depth->write(image);
      const std::int64_t later = stamp + 5'000'000;  // between two images
      tf->write(ros::TFMessage{{{header_at(later, "map"),
                                 "base",
                                 {1e-9 * static_cast<double>(later), 2.0, 0.0},
                                 {0.0, 0.0, 0.0, 1.0}}}});
    };
  });
  const auto source = open("ros2:/camera/depth/image_raw");
  for (int i = 0; i < 3; ++i) {
    const Frame frame = frame_of(*source);
    const Eigen::Isometry3d pose =
        dynamic_cast<const DepthImage&>(*frame.cloud).world_from_camera();
    // No farther from it than the tolerance for the time of a transform
    EXPECT_NEAR(pose.translation().x(), frame.stamp, 0.0201);
    EXPECT_NEAR(pose.translation().y(), 2.0, 1e-9);
    EXPECT_NEAR(pose.translation().z(), 0.5, 1e-9);
    EXPECT_TRUE((pose.linear() * Vec3::UnitZ()).isApprox(Vec3::UnitY(), 1e-9));
  }
  ASSERT_EQ(source->info().notes.size(), 1U);
  EXPECT_NE(source->info().notes[0].find("points are in map"), std::string::npos);
}

double wall_clock() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

// What palpate serves comes back to the bit: values, unit, lens and pose; its stamps on the clock
// of this machine.
TEST_F(Ros2Camera, ReadsWhatIsServed) {
  Eigen::Isometry3d pose(Eigen::AngleAxisd(0.5, Vec3(0.6, 0.0, 0.8)));
  pose.translation() = Vec3(1.0, -2.0, 3.0);
  Intrinsics k{.width = width, .height = height, .fx = 9.5, .fy = 9.0, .cx = 3.0, .cy = 2.0};
  k.distortion[1] = 0.25;
  const DepthImage served(std::make_shared<const ViewingRays>(k), a_depth(), 10000.0, pose);
  std::atomic<bool> ends{false};
  const double begin = monotonic_now();
  std::thread thread([&] {
    Ros2CameraPublisher rvl("robot/camera");
    Ros2CameraPublisher png("robot/other", DepthPacking::png);
    while (!ends) {
      rvl.publish(served, wall_clock());
      png.publish(served, wall_clock());
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  });
  for (const std::string topic :
       {"camera/depth/image_raw/compressedDepth?reliable&",
        "other/depth/image_raw/compressedDepth?reliable&", "camera/depth/image_raw/slices?"}) {
    const auto source = open("ros2:/robot/" + topic + "wait=60s");
    EXPECT_EQ(source->info().clock, StampClock::monotonic);
    const Frame frame = frame_of(*source);
    const auto& image = dynamic_cast<const DepthImage&>(*frame.cloud);
    EXPECT_EQ(depth_of(image), a_depth());
    EXPECT_EQ(image.units_per_metre(), 10000.0);
    EXPECT_EQ(image.intrinsics(), k);
    EXPECT_TRUE(image.world_from_camera().isApprox(pose, 1e-12));
    // Captured between the begin and now, as well as the clocks are known
    EXPECT_GE(frame.stamp, begin - 0.5);
    EXPECT_LE(frame.stamp, monotonic_now() + 0.5);
    const std::string note = source->info().notes.at(0);
    EXPECT_NE(note.find("points are in world"), std::string::npos) << note;
    EXPECT_NE(note.find("clock is known within"), std::string::npos) << note;
  }
  ends = true;
  thread.join();
  EXPECT_TRUE(test::fails_saying([] { return std::make_unique<Ros2CameraPublisher>("my camera"); },
                                 "'my camera'"));
}

TEST_F(Ros2Camera, SaysWhatIsThereInstead) {
  const Publisher publisher =
      camera("/camera/depth/image_raw", image_of("16UC1", bytes_of(a_depth())));
  EXPECT_TRUE(test::fails_saying([] { return open("ros2:/camera/deep/image_raw?wait=1s"); },
                                 "nobody publishes /camera/deep/image_raw", "domain",
                                 "there are: /camera/depth/image_raw"));
  EXPECT_TRUE(test::fails_saying([] { return open("ros2:/camera/depth/camera_info"); },
                                 "sensor_msgs/msg/CameraInfo", "not of a camera"));
  EXPECT_TRUE(test::fails_saying([] { return open("ros2:"); }, "names no topic"));
  EXPECT_TRUE(test::fails_saying([] { return open("ros2:/a?stamps=mine"); }, "stamps=mine"));
  const DriverReport report = standard_drivers().find("ros2").look();
  EXPECT_EQ(report.problem, "");
  EXPECT_NE(report.library, "");
}

}  // namespace test_ros2_camera
}  // namespace palpate
