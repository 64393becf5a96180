// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/ros2_publisher.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/drivers/dds.hpp"
#include "palpate/sources/depth_png.hpp"
#include "palpate/sources/ros_frames.hpp"
#include "palpate/sources/transforms.hpp"

namespace palpate {
namespace {

constexpr dds::Quality reliable{.reliable = true};
constexpr dds::Quality latched{.reliable = true, .keeps_for_late = true};

// @throws Error if it is no name.
std::string checked_name(const std::string& name) {
  const bool is_good =
      !name.empty() &&
      std::all_of(name.begin(), name.end(),
                  [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '/'; }) &&
      name.front() != '/' && name.back() != '/' && name.find("//") == std::string::npos;
  if (!is_good)
    throw Error("name", "'" + name + "' is none for a topic",
                "write letters, digits and _, such as robot/camera");
  return name;
}

}  // namespace

struct Ros2CameraPublisher::Topics {
  explicit Topics(const std::string& wanted)
      : name(checked_name(wanted)),
        participant("ros2:" + name),
        topic("/" + name + "/depth/image_raw/compressedDepth"),
        images(participant, topic, ros::CompressedImage{}, reliable),
        lenses(participant, "/" + name + "/depth/camera_info", ros::CameraInfo{}, reliable),
        transforms(participant, std::string(transforms_topic), ros::TFMessage{}, reliable),
        units(participant, units_topic("/" + name + "/depth"), ros::Float64MultiArray{}, latched) {}

  std::string name;
  dds::Participant participant;
  std::string topic;
  dds::Writer images, lenses, transforms, units;
  double told_units = 0.0;  // [1/m]
};

Ros2CameraPublisher::Ros2CameraPublisher(const std::string& name)
    : topics_(std::make_unique<Topics>(name)) {}
Ros2CameraPublisher::~Ros2CameraPublisher() = default;

void Ros2CameraPublisher::publish(const DepthImage& image, double stamp) {
  const Intrinsics& k = image.intrinsics();
  const auto nanoseconds = static_cast<std::int64_t>(std::llround(1e9 * stamp));
  const std::string frame = topics_->name + "_optical_frame";
  const ros::Header header{ros::Time::at(nanoseconds), frame};
  if (image.units_per_metre() != topics_->told_units) {
    topics_->told_units = image.units_per_metre();
    topics_->units.write(ros::Float64MultiArray{"units_per_metre", {topics_->told_units}});
  }
  topics_->transforms.write(
      ros::TFMessage{{transform_of({header.stamp, "world"}, frame, image.world_from_camera())}});
  topics_->lenses.write(camera_info_of(header, k));
  topics_->images.write(
      compressed_depth(header, encode_depth_png(k.width, k.height, image.depth())));
}

const std::string& Ros2CameraPublisher::topic() const {
  return topics_->topic;
}
std::uint32_t Ros2CameraPublisher::domain() const {
  return topics_->participant.domain();
}
int Ros2CameraPublisher::readers() const {
  return topics_->images.readers();
}

}  // namespace palpate
