// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/bag_colour.hpp"

#include <algorithm>
#include <cstdlib>

#include "palpate/io/bag/messages.hpp"
#include "palpate/io/sources/realsense_lens.hpp"
#include "palpate/io/sources/ros_frames.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

constexpr std::int64_t farthest = 100'000'000;  // [ns] from a depth image

bool is_colour(const BagReader::Topic& topic) {
  const std::string name = lower_case(topic.name);
  return topic.type == ros::Image::type && !is_topic_of_depth(topic.name, topic.type) &&
         (name.find("color") != std::string::npos || name.find("colour") != std::string::npos ||
          name.find("rgb") != std::string::npos);
}

std::ptrdiff_t alike(const std::string& a, const std::string& b) {
  return std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first - a.begin();
}

// The lens without its distortion, on one of the two topics that bags have it on.
std::optional<Intrinsics> lens_of(BagReader& bag, const std::string& camera) {
  for (const char* last : {"/info/camera_info", "/camera_info"}) {
    const std::vector<BagReader::Place> places = bag.places(camera + last);
    if (places.empty()) continue;
    const std::string name = bag.name(camera + last, places.front());
    const std::vector<std::byte> bytes = bag.read(places.front());
    if (bag.find(camera + last)->type == ros::String::type) {
      RealSenseLens lens = parse_realsense_lens(ros::decode<ros::String>(bytes, name).data, name);
      lens.coeffs = {};
      return intrinsics_of(lens, name);
    }
    auto info = ros::decode<ros::CameraInfo>(bytes, name);
    info.d.clear();
    return intrinsics_of(info, false, name);
  }
  return std::nullopt;
}

}  // namespace

std::string BagColour::topic_beside(BagReader& bag, const std::string& depth) {
  std::string best;
  for (const BagReader::Topic& topic : bag.topics()) {
    if (!is_colour(topic) || bag.places(topic.name).empty()) continue;
    if (best.empty() || alike(topic.name, depth) > alike(best, depth)) best = topic.name;
  }
  return best;
}

// Where the stream stands from the device's first, as librealsense has it; none: not told.
std::optional<Eigen::Isometry3d> BagColour::realsense_pose(const std::string& camera) const {
  for (const BagReader::Topic& topic : bag_.topics()) {
    if (!topic.name.starts_with(camera + "/tf/") || topic.type != ros::Transform::type) continue;
    const std::vector<BagReader::Place> places = bag_.places(topic.name);
    if (places.empty()) continue;
    const std::string name = bag_.name(topic.name, places.front());
    const auto told = ros::decode<ros::Transform>(bag_.read(places.front()), name);
    ros::TransformStamped stream_from_first;
    stream_from_first.translation = told.translation;
    stream_from_first.rotation = told.rotation;
    return pose_of(sample_of(stream_from_first, name)).inverse();
  }
  return std::nullopt;
}

BagColour::BagColour(BagReader& bag, const std::string& topic, const std::string& depth,
                     const std::string& frame, const BagTransforms* pose)
    : bag_(bag), topic_(topic), places_(bag.places(topic)) {
  const std::string camera = camera_of_topic(topic, std::string(ros::Image::type));
  const std::optional<Intrinsics> lens = lens_of(bag, camera);
  if (!lens) throw Error("topic " + topic, "has no CameraInfo", "record that topic too");
  intrinsics_ = *lens;
  const std::string name = bag_.name(topic_, places_.front());
  const auto first = ros::decode<ros::Image>(bag_.read(places_.front()), name);
  static_cast<void>(rgb_of(first, name));
  if (const auto first_from_colour = realsense_pose(camera)) {
    const auto first_from_depth = realsense_pose(camera_of_topic(depth, bag.find(depth)->type));
    if (first_from_depth) depth_from_colour_ = first_from_depth->inverse();
    depth_from_colour_ = depth_from_colour_ * *first_from_colour;
    return;
  }
  const std::string& own = first.header.frame_id;
  if (plain_frame(own) == plain_frame(frame)) return;
  if (pose == nullptr)
    throw Error("topic " + topic_, "its camera pose relative to the depth camera is unknown",
                "record /tf_static, too");
  const bool in_world = !pose->fixed_frame().empty();
  const std::string& fixed = in_world ? pose->fixed_frame() : pose->root();
  colour_in_.emplace(bag_, own, fixed);
  if (!in_world) depth_in_.emplace(bag_, frame, fixed);
}

std::shared_ptr<const ColourImage> BagColour::at(std::int64_t nanoseconds, double stamp,
                                                 const Eigen::Isometry3d& world_from_depth) {
  const auto away = [&](const BagReader::Place& place) {
    return std::abs(place.nanoseconds - nanoseconds);
  };
  const auto nearest =
      std::min_element(places_.begin(), places_.end(),
                       [&](const auto& a, const auto& b) { return away(a) < away(b); });
  if (away(*nearest) > farthest) return nullptr;
  ColourImage::Camera camera{intrinsics_, world_from_depth * depth_from_colour_};
  if (colour_in_) {
    const auto in_fixed = colour_in_->at(stamp);
    const auto depth_in_fixed = depth_in_ ? depth_in_->at(stamp) : std::nullopt;
    if (!in_fixed || (depth_in_ && !depth_in_fixed)) return nullptr;
    camera.world_from_camera =
        depth_in_ ? world_from_depth * depth_in_fixed->inverse() * *in_fixed : *in_fixed;
  }
  try {
    const std::string name = bag_.name(topic_, *nearest);
    const auto image = ros::decode<ros::Image>(bag_.read(*nearest), name);
    auto colour = std::make_shared<ColourImage>();
    colour->width = static_cast<int>(image.width);
    colour->height = static_cast<int>(image.height);
    colour->rgb = rgb_of(image, name);
    colour->camera = camera;
    return colour;
  } catch (const Error&) {
    return nullptr;
  }
}

}  // namespace palpate
