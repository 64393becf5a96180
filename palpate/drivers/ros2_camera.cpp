// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/ros2_camera.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/cloud/depth_image.hpp"
#include "palpate/cloud/point_cloud.hpp"
#include "palpate/core/error.hpp"
#include "palpate/drivers/dds.hpp"
#include "palpate/drivers/live_camera.hpp"
#include "palpate/drivers/words.hpp"
#include "palpate/servo/realtime.hpp"
#include "palpate/sources/ros_frames.hpp"
#include "palpate/sources/transforms.hpp"

namespace palpate {
namespace ros2 {
namespace {

constexpr double least_patience = 0.05;  // [s] between two looks at what is published
// [s] for which a frame waits for a transform that covers it: /tf comes at 10 to 100 Hz
constexpr double longest_wait_for_tf = 0.1;
constexpr double time_to_settle = 2.0;  // [s] within which TF is heard of
constexpr dds::Quality best_effort{};
constexpr dds::Quality latched{.reliable = true, .keeps_for_late = true};
// /tf has a message from each of its nodes: the last one alone would lose theirs
constexpr dds::Quality of_tf{.depth = 100};
constexpr dds::Quality of_static_tf{.reliable = true, .keeps_for_late = true, .depth = 100};

struct CameraOptions {
  std::string uri = {}, topic = {}, info_topic = {}, fixed_frame = {}, stamps = {};
  std::optional<double> units = {};  // [1/m]
  double voxel = 0.01;               // [m]
  double patience = 5.0;             // [s] for the camera to be there
  bool reliable = false;             // what is lost on the way is sent again
};

CameraOptions camera_options(const Uri& uri) {
  constexpr std::array<std::string_view, 8> options{"reliable",    "info",   "units", "voxel",
                                                    "fixed_frame", "stamps", "wait",  "sensor"};
  uri.allow_only(options);
  CameraOptions wanted{.uri = uri.text(), .topic = uri.path()};
  if (wanted.topic.size() < 2 || wanted.topic.front() != '/')
    throw Error(uri.text(), "names no topic",
                "write ros2:/camera/camera/depth/image_rect_raw; palpate doctor lists those of "
                "depth that are published");
  wanted.info_topic = uri.text_option("info", "");
  wanted.reliable = uri.has("reliable");
  if (uri.has("units")) wanted.units = uri.number_option("units", 1000.0, 1.0, 1e6);
  wanted.voxel = uri.number_option("voxel", wanted.voxel, 1e-4, 1.0, "m");
  wanted.fixed_frame = uri.text_option("fixed_frame", "");
  wanted.patience = uri.number_option("wait", wanted.patience, 0.1, 600.0, "s");
  wanted.stamps = uri.text_option("stamps", "system");
  if (wanted.stamps != "system" && wanted.stamps != "sensor")
    throw Error(uri.text(), "stamps=" + wanted.stamps + " is not known",
                "write stamps=system, or stamps=sensor for a camera with a clock of its own");
  return wanted;
}

// A frame whose pose is still to come.
struct Pending {
  double stamp = 0.0;    // [s] since 1970
  double arrival = 0.0;  // [s, monotonic]
  std::string tf_frame;
  std::vector<std::uint16_t> depth;
  double units = 0.0;  // [1/m]
  std::optional<std::vector<Vec3>> points;
};

bool is_of_camera(const std::string& type) {
  return type == ros::Image::type || type == ros::CompressedImage::type ||
         type == ros::PointCloud2::type;
}

class Camera final : public LiveCamera {
 public:
  explicit Camera(const Uri& uri)
      : LiveCamera({.uri = uri.text(), .kind = "ROS 2"}),
        wanted_(camera_options(uri)),
        participant_(uri.text()),
        opened_(monotonic_now()) {
    info_.sensor = sensor_option(uri, SensorKind::unknown);
    info_.clock = wanted_.stamps == "system" ? StampClock::system : StampClock::sensor;
    const std::string type = wait_for_type();
    info_.kind = "ROS 2, " + type;
    info_name_ = wanted_.info_topic.empty() ? camera_of_topic(wanted_.topic, type) + "/camera_info"
                                            : wanted_.info_topic;
    const dds::Quality quality{.reliable = wanted_.reliable};
    if (type == ros::Image::type) {
      images_.emplace(participant_, wanted_.topic, ros::Image{}, quality);
    } else if (type == ros::CompressedImage::type) {
      packed_.emplace(participant_, wanted_.topic, ros::CompressedImage{}, quality);
    } else {
      clouds_.emplace(participant_, wanted_.topic, ros::PointCloud2{}, quality);
    }
    if (!clouds_) lenses_.emplace(participant_, info_name_, ros::CameraInfo{}, best_effort);
    if (packed_ && !wanted_.units) {
      const std::string units = units_topic(camera_of_topic(wanted_.topic, type));
      const std::vector<dds::Publication> heard = participant_.publications();
      if (std::any_of(heard.begin(), heard.end(),
                      [&](const auto& one) { return one.topic == units; }))
        told_units_.emplace(participant_, units, ros::Float64MultiArray{}, latched);
    }
    if (wanted_.fixed_frame != "none") {
      tf_.emplace(participant_, std::string(transforms_topic), ros::TFMessage{}, of_tf);
      static_tf_.emplace(participant_, std::string(static_transforms_topic), ros::TFMessage{},
                         of_static_tf);
    }
  }

 private:
  std::string wait_for_type() {
    const double end = monotonic_now() + wanted_.patience;
    for (;;) {
      const std::vector<dds::Publication> heard = participant_.publications();
      std::string others;
      std::string other_type;
      for (const dds::Publication& one : heard) {
        if (one.topic == wanted_.topic) {
          if (is_of_camera(one.type)) return one.type;
          other_type = one.type;
        }
        if (is_topic_of_depth(one.topic, one.type)) add_to_list(others, one.topic);
      }
      if (!other_type.empty())
        throw Error(wanted_.uri, wanted_.topic + " is of " + other_type + ", not of a camera",
                    "name a topic of Image, CompressedImage or PointCloud2");
      if (monotonic_now() > end)
        throw Error(wanted_.uri,
                    "nobody publishes " + wanted_.topic + " in domain " +
                        std::to_string(participant_.domain()),
                    others.empty()
                        ? "start the camera's driver, or set ROS_DOMAIN_ID to its domain; nothing "
                          "of depth is published there"
                        : "there are: " + others);
      participant_.wait(least_patience);
    }
  }

  std::optional<Frame> wait(double seconds) override {
    participant_.wait(pending_ ? std::min(seconds, 0.005) : seconds);
    take_transforms();
    take_lens();
    take_units();
    take_newest();
    if (!pending_) return std::nullopt;
    return frame_of_pending();
  }

  void take_transforms() {
    if (!tf_) return;
    while (const auto message = static_tf_->take<ros::TFMessage>())
      transforms_.add(*message, false, wanted_.uri + ": /tf_static");
    while (const auto message = tf_->take<ros::TFMessage>())
      transforms_.add(*message, true, wanted_.uri + ": /tf");
  }

  void take_units() {
    if (!told_units_) return;
    while (const auto units = told_units_->take<ros::Float64MultiArray>()) {
      if (units->data.size() != 1 || !(units->data[0] >= 1.0 && units->data[0] <= 1e6))
        throw Error(wanted_.uri, "tells no unit of depth that can be", "give ?units=");
      units_ = units->data[0];
    }
  }

  void take_lens() {
    if (!lenses_) return;
    while (const auto info = lenses_->take<ros::CameraInfo>()) {
      const bool is_rectified = wanted_.topic.find("rect") != std::string::npos;
      const Intrinsics k = intrinsics_of(*info, is_rectified, wanted_.uri + ": " + info_name_);
      if (!rays_ || !(rays_->intrinsics() == k)) rays_ = std::make_shared<const ViewingRays>(k);
    }
  }

  // The newest message; one that a frame still waits with gives way to it.
  void take_newest() {
    const std::string name = wanted_.uri + ": message";
    if (clouds_) {
      while (const auto cloud = clouds_->take<ros::PointCloud2>()) {
        Pending& next = begin(cloud->header);
        next.points = points_of(*cloud, name);
        info_.details = "PointCloud2";
      }
    } else if (images_) {
      while (const auto image = images_->take<ros::Image>()) take_image(*image, name);
    } else {
      while (auto packed = packed_->take<ros::CompressedImage>()) {
        const bool floats = is_float(packed->format.substr(0, packed->format.find(';')));
        if (told_units_ && !units_) continue;  // it is still to come
        const double units = wanted_.units ? *wanted_.units
                             : units_      ? *units_
                             : floats      ? units_of_32fc1
                                           : units_of_16uc1;
        const std::string format = packed->format;
        ros::Image depth = unpacked(std::move(*packed), units, name);
        take_image(depth, name, units);
        info_.details = format;
      }
    }
  }

  void take_image(const ros::Image& image, const std::string& name,
                  std::optional<double> known_units = std::nullopt) {
    const double units = known_units ? *known_units
                         : wanted_.units
                             ? *wanted_.units
                             : (is_float(image.encoding) ? units_of_32fc1 : units_of_16uc1);
    std::vector<std::uint16_t> depth = raw_depth(image, units, name);
    info_.details = image.encoding;
    if (!rays_) return;  // its CameraInfo comes beside it
    const Intrinsics& k = rays_->intrinsics();
    if (k.width != static_cast<int>(image.width) || k.height != static_cast<int>(image.height))
      throw Error(wanted_.uri,
                  "gives images of " + std::to_string(image.width) + "x" +
                      std::to_string(image.height) + " pixels, but " + info_name_ + " says " +
                      std::to_string(k.width) + "x" + std::to_string(k.height),
                  "name the CameraInfo that belongs to it with ?info=/TOPIC");
    Pending& next = begin(image.header);
    next.depth = std::move(depth);
    next.units = units;
  }

  Pending& begin(const ros::Header& header) {
    pending_.emplace();
    pending_->arrival = monotonic_now();
    pending_->stamp = 1e-9 * static_cast<double>(header.stamp.nanoseconds());
    pending_->tf_frame = header.frame_id;
    return *pending_;
  }

  // In which frame points are is decided once: a pose that came later would move the whole scene.
  // TF takes a moment to arrive, so the first frames wait for it where somebody publishes it.
  // @throws Error if the fixed frame that is wanted does not come.
  bool decide_pose(const std::string& tf_frame) {
    if (decided_) return true;
    const bool settled = monotonic_now() - opened_ > time_to_settle;
    const TransformWay way = transforms_.links().way(tf_frame, "", "TF");
    if (!wanted_.fixed_frame.empty() && wanted_.fixed_frame != "none") {
      if (!settled && !leads(tf_frame)) return false;
      fixed_ = transforms_.links().way(tf_frame, wanted_.fixed_frame, "TF").fixed;
    } else if (tf_) {
      const std::vector<dds::Publication> heard = participant_.publications();
      const bool is_there = std::any_of(heard.begin(), heard.end(), [](const auto& one) {
        return one.topic == transforms_topic || one.topic == static_transforms_topic;
      });
      if (!settled && is_there && way.fixed.empty()) return false;
      fixed_ = way.fixed;
    }
    decided_ = true;
    info_.notes = {fixed_.empty()
                       ? "points are in the camera's own frame" +
                             std::string(tf_ ? ", as TF leads from none of map, odom and world "
                                               "to it"
                                             : ", as TF is left aside")
                       : "points are in " + fixed_ +
                             ", by TF; frames for whose time it has no "
                             "transform are left out"};
    return true;
  }
  [[nodiscard]] bool leads(const std::string& tf_frame) const {
    try {
      return !transforms_.links().way(tf_frame, wanted_.fixed_frame, "TF").fixed.empty();
    } catch (const Error&) {
      return false;
    }
  }

  std::optional<Frame> frame_of_pending() {
    if (!decide_pose(pending_->tf_frame)) return std::nullopt;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    if (!fixed_.empty()) {
      const TransformWay way = transforms_.links().way(pending_->tf_frame, fixed_, "TF");
      const bool late = monotonic_now() - pending_->arrival > longest_wait_for_tf;
      if (!late && !transforms_.reach(way, pending_->stamp)) return std::nullopt;
      const std::optional<Eigen::Isometry3d> found = transforms_.at(way, pending_->stamp);
      if (!found) {
        pending_.reset();
        return std::nullopt;
      }
      pose = *found;
    }
    Frame frame;
    frame.stamp = pending_->stamp;
    frame.arrival = pending_->arrival;
    if (pending_->points) {
      for (Vec3& point : *pending_->points) point = pose * point;
      frame.cloud = std::make_shared<PointCloud>(*pending_->points, std::nullopt, wanted_.voxel);
    } else {
      frame.cloud =
          std::make_shared<DepthImage>(rays_, std::move(pending_->depth), pending_->units, pose);
    }
    pending_.reset();
    return frame;
  }

  const CameraOptions wanted_;
  dds::Participant participant_;
  const double opened_;    // [s, monotonic]
  std::string info_name_;  // topic of CameraInfo
  std::optional<dds::Reader> images_, packed_, clouds_, lenses_, told_units_, tf_, static_tf_;
  std::optional<double> units_;  // [1/m] as a camera of palpate's tells
  LiveTransforms transforms_;
  std::shared_ptr<const ViewingRays> rays_;
  std::optional<Pending> pending_;
  bool decided_ = false;
  std::string fixed_;  // frame of TF in which points are; empty: the camera's own
};

}  // namespace
}  // namespace ros2

std::unique_ptr<Source> open_ros2_camera(const Uri& uri) {
  return std::make_unique<ros2::Camera>(uri);
}

}  // namespace palpate
