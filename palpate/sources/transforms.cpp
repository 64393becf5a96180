// SPDX-License-Identifier: Apache-2.0
#include "palpate/sources/transforms.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

constexpr std::size_t most_tf_frames = 10'000;
constexpr std::size_t most_samples = 20'000;  // of a frame: 5 s at 4 kHz

bool has_transforms(const BagReader& bag, std::string_view name) {
  const BagReader::Topic* topic = bag.find(name);
  return topic != nullptr && topic->type == ros::TFMessage::type;
}

// Calls visit(transform, moves, name of its message) for each transform, static ones first.
template <class Visit>
void for_each_transform(BagReader& bag, const Visit& visit) {
  for (const std::string_view topic : {static_transforms_topic, transforms_topic}) {
    if (!has_transforms(bag, topic)) continue;
    for (const BagReader::Place& place : bag.places(topic)) {
      const std::string name = bag.name(topic, place);
      for (const auto& transform : ros::decode<ros::TFMessage>(bag.read(place), name).transforms)
        visit(transform, topic == transforms_topic, name);
    }
  }
}

}  // namespace

std::string plain_frame(const std::string& frame) {
  return frame.starts_with('/') ? frame.substr(1) : frame;
}

Trajectory::Sample sample_of(const ros::TransformStamped& transform, const std::string& name) {
  const auto& [x, y, z] = transform.translation;
  const auto& [qx, qy, qz, qw] = transform.rotation;
  const Eigen::Quaterniond rotation(qw, qx, qy, qz);
  const Eigen::Vector3d translation(x, y, z);
  if (!translation.allFinite() || !(std::abs(rotation.norm() - 1.0) < 0.01))
    throw Error(name, "has a transform to " + transform.child_frame_id + " that is not rigid",
                "ignore TF with ?fixed_frame=none");
  return {transform.header.stamp.seconds(), translation, rotation.normalized()};
}

Eigen::Isometry3d pose_of(const Trajectory::Sample& sample) {
  Eigen::Isometry3d pose(sample.rotation);
  pose.translation() = sample.translation;
  return pose;
}

ros::TransformStamped transform_of(const ros::Header& header, const std::string& child,
                                   const Eigen::Isometry3d& parent_from_child) {
  const Eigen::Quaterniond q(parent_from_child.linear());
  const Eigen::Vector3d p = parent_from_child.translation();
  return {.header = header,
          .child_frame_id = child,
          .translation = {p.x(), p.y(), p.z()},
          .rotation = {q.x(), q.y(), q.z(), q.w()}};
}

void TransformLinks::add(const ros::TransformStamped& transform, bool moves,
                         const std::string& name) {
  links_[plain_frame(transform.child_frame_id)] = {plain_frame(transform.header.frame_id), moves};
  if (links_.size() > most_tf_frames) throw Error(name, "has too many frames", "it may be damaged");
}

TransformWay TransformLinks::way(const std::string& frame, const std::string& fixed,
                                 const std::string& whose) const {
  // From the camera upwards; a way in a circle ends when all links were used.
  TransformWay result;
  std::vector<std::string>& way = result.children;
  way.push_back(plain_frame(frame));
  for (auto link = links_.find(way.back()); link != links_.end() && way.size() <= links_.size();
       link = links_.find(way.back()))
    way.push_back(link->second.parent);
  result.root = way.back();
  std::vector<std::string> wanted{"map", "odom", "world"};
  if (!fixed.empty()) wanted = {plain_frame(fixed)};
  auto end = way.end();
  for (const std::string& each : wanted) {
    if (end == way.end()) end = std::find(way.begin(), way.end(), each);
  }
  if (end == way.end()) {
    way.clear();
    if (fixed.empty()) return result;
    throw Error("fixed frame " + fixed, "does not lead to " + frame + " in " + whose,
                result.root == frame ? "leave it out" : result.root + " does");
  }
  result.fixed = *end;
  way.erase(end, way.end());
  return result;
}

bool TransformLinks::holds(const ros::TransformStamped& transform, bool moves) const {
  const auto found = links_.find(plain_frame(transform.child_frame_id));
  return found != links_.end() && found->second.moves == moves &&
         found->second.parent == plain_frame(transform.header.frame_id);
}

void LiveTransforms::add(const ros::TFMessage& message, bool moves, const std::string& name) {
  for (const ros::TransformStamped& transform : message.transforms) {
    const Trajectory::Sample sample = sample_of(transform, name);
    const bool goes_on = links_.holds(transform, moves);
    links_.add(transform, moves, name);
    std::deque<Trajectory::Sample>& line = samples_[plain_frame(transform.child_frame_id)];
    if (!goes_on || !moves) line.clear();
    // A clock that was set back begins again; several nodes' transforms may overtake one another.
    if (!line.empty() && sample.stamp < line.back().stamp - kept) line.clear();
    if (!line.empty() && !(sample.stamp > line.back().stamp)) continue;
    line.push_back(sample);
    while (line.size() > most_samples || line.front().stamp < sample.stamp - kept) line.pop_front();
  }
}

std::optional<Eigen::Isometry3d> LiveTransforms::at(const TransformWay& way, double stamp) const {
  Eigen::Isometry3d fixed_from_camera = Eigen::Isometry3d::Identity();
  for (const std::string& child : way.children) {
    const auto found = samples_.find(child);
    if (found == samples_.end() || found->second.empty()) return std::nullopt;
    const std::deque<Trajectory::Sample>& line = found->second;
    if (!links_.moves(child)) {
      fixed_from_camera = pose_of(line.back()) * fixed_from_camera;
      continue;
    }
    const auto after = std::lower_bound(line.begin(), line.end(), stamp,
                                        [](const auto& one, double t) { return one.stamp < t; });
    std::vector<Trajectory::Sample> around;
    if (after != line.begin()) around.push_back(*(after - 1));
    if (after != line.end()) around.push_back(*after);
    const std::optional<Eigen::Isometry3d> parent_from_child =
        Trajectory(std::move(around), max_gap).at(stamp);
    if (!parent_from_child) return std::nullopt;
    fixed_from_camera = *parent_from_child * fixed_from_camera;
  }
  return fixed_from_camera;
}

bool LiveTransforms::reach(const TransformWay& way, double stamp) const {
  return std::all_of(way.children.begin(), way.children.end(), [&](const std::string& child) {
    const auto found = samples_.find(child);
    return found != samples_.end() && !found->second.empty() &&
           (!links_.moves(child) || found->second.back().stamp >= stamp);
  });
}

bool BagTransforms::are_in(const BagReader& bag) {
  return has_transforms(bag, transforms_topic) || has_transforms(bag, static_transforms_topic);
}

BagTransforms::BagTransforms(BagReader& bag, const std::string& frame, const std::string& fixed) {
  TransformLinks links;
  for_each_transform(bag, [&](const auto& transform, bool moves, const std::string& name) {
    links.add(transform, moves, name);
  });
  const TransformWay way = links.way(frame, fixed, "the bag's TF");
  root_ = way.root;
  fixed_ = way.fixed;
  if (fixed_.empty()) return;

  std::map<std::string, std::vector<Trajectory::Sample>> samples;
  for (const std::string& child : way.children) samples[child];
  for_each_transform(bag, [&](const auto& transform, bool moves, const std::string& name) {
    const auto found = samples.find(plain_frame(transform.child_frame_id));
    if (found == samples.end()) return;
    if (!links.holds(transform, moves)) return;
    if (!moves) found->second.clear();
    found->second.push_back(sample_of(transform, name));
  });
  for (const std::string& child : way.children) {
    std::vector<Trajectory::Sample>& line = samples.at(child);
    order_.push_back(links.moves(child));
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
