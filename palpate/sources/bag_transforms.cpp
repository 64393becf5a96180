// SPDX-License-Identifier: Apache-2.0
#include "palpate/sources/bag_transforms.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "palpate/bag/messages.hpp"
#include "palpate/core/error.hpp"

namespace palpate {
namespace {

constexpr std::string_view moving_topic = "/tf";
constexpr std::string_view static_topic = "/tf_static";
constexpr std::size_t most_tf_frames = 10'000;

// ROS 1 wrote them with a slash.
std::string plain_frame(const std::string& frame) {
  return frame.starts_with('/') ? frame.substr(1) : frame;
}

bool has_transforms(const BagReader& bag, std::string_view name) {
  const BagReader::Topic* topic = bag.find(name);
  return topic != nullptr && topic->type == ros::TFMessage::type;
}

// Calls visit(transform, moves, name of its message) for each transform, static ones first.
template <class Visit>
void for_each_transform(BagReader& bag, const Visit& visit) {
  for (const std::string_view topic : {static_topic, moving_topic}) {
    if (!has_transforms(bag, topic)) continue;
    for (const BagReader::Place& place : bag.places(topic)) {
      const std::string name = bag.name(topic, place);
      for (const auto& transform : ros::decode<ros::TFMessage>(bag.read(place), name).transforms)
        visit(transform, topic == moving_topic, name);
    }
  }
}

Trajectory::Sample sample_of(const ros::TransformStamped& transform, const std::string& name) {
  const auto& [x, y, z] = transform.translation;
  const auto& [qx, qy, qz, qw] = transform.rotation;
  const Eigen::Quaterniond rotation(qw, qx, qy, qz);
  const Eigen::Vector3d translation(x, y, z);
  if (!translation.allFinite() || !(std::abs(rotation.norm() - 1.0) < 0.01))
    throw Error(name, "has a transform to " + transform.child_frame_id + " that is not rigid",
                "leave TF aside with ?fixed_frame=none");
  return {1e-9 * static_cast<double>(transform.header.stamp.nanoseconds()), translation,
          rotation.normalized()};
}

Eigen::Isometry3d pose_of(const Trajectory::Sample& sample) {
  Eigen::Isometry3d pose(sample.rotation);
  pose.translation() = sample.translation;
  return pose;
}

}  // namespace

bool BagTransforms::are_in(const BagReader& bag) {
  return has_transforms(bag, moving_topic) || has_transforms(bag, static_topic);
}

BagTransforms::BagTransforms(BagReader& bag, const std::string& frame, const std::string& fixed) {
  struct Link {
    std::string parent;
    bool moves;
  };
  std::map<std::string, Link> links;  // by the child's frame
  for_each_transform(bag, [&](const auto& transform, bool moves, const std::string& name) {
    links[plain_frame(transform.child_frame_id)] = {plain_frame(transform.header.frame_id), moves};
    if (links.size() > most_tf_frames)
      throw Error(name, "has too many frames", "it may be damaged");
  });

  // From the camera upwards; a way in a circle ends when all links were used.
  std::vector<std::string> way{plain_frame(frame)};
  for (auto link = links.find(way.back()); link != links.end() && way.size() <= links.size();
       link = links.find(way.back()))
    way.push_back(link->second.parent);
  root_ = way.back();
  std::vector<std::string> wanted{"map", "odom", "world"};
  if (!fixed.empty()) wanted = {plain_frame(fixed)};
  auto end = way.end();
  for (const std::string& each : wanted) {
    if (end == way.end()) end = std::find(way.begin(), way.end(), each);
  }
  if (end == way.end()) {
    if (fixed.empty()) return;
    throw Error("fixed frame " + fixed, "does not lead to " + frame + " in the bag's TF",
                root_ == frame ? "leave it out" : root_ + " does");
  }
  fixed_ = *end;
  way.erase(end, way.end());  // what is left are children, each with a link of its own

  std::map<std::string, std::vector<Trajectory::Sample>> samples;
  for (const std::string& child : way) samples[child];
  for_each_transform(bag, [&](const auto& transform, bool moves, const std::string& name) {
    const auto found = samples.find(plain_frame(transform.child_frame_id));
    if (found == samples.end()) return;
    const Link& link = links.at(found->first);
    if (link.moves != moves || link.parent != plain_frame(transform.header.frame_id)) return;
    if (!moves) found->second.clear();
    found->second.push_back(sample_of(transform, name));
  });
  for (const std::string& child : way) {
    std::vector<Trajectory::Sample>& line = samples.at(child);
    order_.push_back(links.at(child).moves);
    if (!order_.back()) {
      still_.push_back(pose_of(line.back()));
      continue;
    }
    std::stable_sort(line.begin(), line.end(),
                     [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
    line.erase(std::unique(line.begin(), line.end(),
                           [](const auto& a, const auto& b) { return a.stamp == b.stamp; }),
               line.end());
    moving_.emplace_back(std::move(line), max_gap);
  }
}

std::optional<Eigen::Isometry3d> BagTransforms::at(double stamp) const {
  Eigen::Isometry3d fixed_from_camera = Eigen::Isometry3d::Identity();
  auto moving = moving_.begin();
  auto still = still_.begin();
  for (const bool moves : order_) {
    if (!moves) {
      fixed_from_camera = *still++ * fixed_from_camera;
      continue;
    }
    const std::optional<Eigen::Isometry3d> parent_from_child = (moving++)->at(stamp);
    if (!parent_from_child) return std::nullopt;
    fixed_from_camera = *parent_from_child * fixed_from_camera;
  }
  return fixed_from_camera;
}

}  // namespace palpate
