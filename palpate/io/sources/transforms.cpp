// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/transforms.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"

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

// Where in a line a sample of that time belongs.
template <class Line>
auto first_after(Line& line, double stamp) {
  return std::upper_bound(line.begin(), line.end(), stamp,
                          [](double t, const auto& one) { return t < one.stamp; });
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
  if (!translation.allFinite() || !is_rotation(rotation))
    throw Error(name, "has a transform to " + transform.child_frame_id + " that is not rigid",
                "ignore TF with ?fixed_frame=none");
  return {transform.header.stamp.seconds(), translation, rotation.normalized()};
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

void Transforms::link(const ros::TransformStamped& transform, bool moves, const std::string& name) {
  links_[plain_frame(transform.child_frame_id)] = {plain_frame(transform.header.frame_id), moves};
  if (links_.size() > most_tf_frames) throw Error(name, "has too many frames", "it may be damaged");
}

TransformWay Transforms::way(const std::string& frame, const std::string& fixed,
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

bool Transforms::holds(const ros::TransformStamped& transform, bool moves) const {
  const auto found = links_.find(plain_frame(transform.child_frame_id));
  return found != links_.end() && found->second.moves == moves &&
         found->second.parent == plain_frame(transform.header.frame_id);
}

void Transforms::add(const ros::TransformStamped& transform, bool moves, const std::string& name) {
  const Trajectory::Sample sample = sample_of(transform, name);
  const bool goes_on = holds(transform, moves);
  link(transform, moves, name);
  std::deque<Trajectory::Sample>& line = samples_[plain_frame(transform.child_frame_id)];
  if (!goes_on || !moves) line.clear();
  // A clock that was set back begins again; several nodes' transforms may overtake one another.
  if (!line.empty() && sample.stamp < line.back().stamp - kept_) line.clear();
  const auto after = first_after(line, sample.stamp);
  if (after != line.begin() && (after - 1)->stamp == sample.stamp) return;
  line.insert(after, sample);
  while (line.front().stamp < line.back().stamp - kept_ ||
         (std::isfinite(kept_) && line.size() > most_samples))
    line.pop_front();
}

std::optional<Eigen::Isometry3d> Transforms::at(const TransformWay& way, double stamp) const {
  Eigen::Isometry3d fixed_from_camera = Eigen::Isometry3d::Identity();
  for (const std::string& child : way.children) {
    const auto found = samples_.find(child);
    if (found == samples_.end() || found->second.empty()) return std::nullopt;
    const std::deque<Trajectory::Sample>& line = found->second;
    if (!links_.at(child).moves) {
      fixed_from_camera = line.back().pose() * fixed_from_camera;
      continue;
    }
    const auto after = first_after(line, stamp);
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

bool Transforms::reach(const TransformWay& way, double stamp) const {
  return std::all_of(way.children.begin(), way.children.end(), [&](const std::string& child) {
    const auto found = samples_.find(child);
    return found != samples_.end() && !found->second.empty() &&
           (!links_.at(child).moves || found->second.back().stamp >= stamp);
  });
}

bool BagTransforms::are_in(const BagReader& bag) {
  return has_transforms(bag, transforms_topic) || has_transforms(bag, static_transforms_topic);
}

BagTransforms::BagTransforms(BagReader& bag, const std::string& frame, const std::string& fixed) {
  Transforms links;
  for_each_transform(bag, [&](const auto& transform, bool moves, const std::string& name) {
    links.link(transform, moves, name);
  });
  way_ = links.way(frame, fixed, "the bag's TF");
  if (way_.fixed.empty()) return;
  for_each_transform(bag, [&](const auto& transform, bool moves, const std::string& name) {
    const auto& on_way = way_.children;
    const std::string child = plain_frame(transform.child_frame_id);
    if (std::find(on_way.begin(), on_way.end(), child) != on_way.end() &&
        links.holds(transform, moves))
      transforms_.add(transform, moves, name);
  });
}

}  // namespace palpate
