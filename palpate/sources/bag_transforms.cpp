// SPDX-License-Identifier: Apache-2.0
#include "palpate/sources/bag_transforms.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "palpate/bag/messages.hpp"
#include "palpate/sources/transforms.hpp"

namespace palpate {
namespace {

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
