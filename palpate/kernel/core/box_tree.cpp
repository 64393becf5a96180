// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/box_tree.hpp"

#include <algorithm>

namespace palpate {
namespace {

constexpr std::size_t items_in_leaf = 4;

}  // namespace

std::vector<std::uint32_t> BoxTree::build(std::span<const Box> boxes) {
  std::vector<Item> items(boxes.size());
  for (std::uint32_t i = 0; i < items.size(); ++i) {
    const Eigen::Vector3f centre = (0.5 * (boxes[i].low + boxes[i].high)).cast<float>();
    items[i] = {{centre.x(), centre.y(), centre.z()}, i};
  }
  nodes_.reserve(boxes.size());
  nodes_.emplace_back();
  build(0, items, 0, boxes);
  std::vector<std::uint32_t> order;
  for (const Item& item : items) order.push_back(item.number);
  return order;
}

void BoxTree::build(std::uint32_t node, std::span<Item> items, std::uint32_t first,
                    std::span<const Box> boxes) {
  if (items.size() <= items_in_leaf) {
    Box box;
    for (const Item& item : items) box.include(boxes[item.number]);
    nodes_[node] = {box, first, static_cast<std::uint32_t>(items.size())};
    return;
  }
  Box centres;
  for (const Item& item : items) centres.include({item.centre[0], item.centre[1], item.centre[2]});
  Eigen::Index longest = 0;
  (centres.high - centres.low).maxCoeff(&longest);
  const auto axis = static_cast<std::size_t>(longest);
  const std::size_t half = items.size() / 2;
  std::nth_element(
      items.begin(), items.begin() + static_cast<std::ptrdiff_t>(half), items.end(),
      [axis](const Item& a, const Item& b) { return a.centre[axis] < b.centre[axis]; });
  const auto child = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  nodes_.emplace_back();
  build(child, items.first(half), first, boxes);
  build(child + 1, items.subspan(half), first + static_cast<std::uint32_t>(half), boxes);
  Box box = nodes_[child].box;
  box.include(nodes_[child + 1].box);
  nodes_[node] = {box, child, 0};
}

}  // namespace palpate
