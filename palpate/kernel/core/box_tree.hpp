// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// A box along the axes [m]; empty before it includes a place.
struct Box {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 high = Vec3::Constant(-std::numeric_limits<double>::infinity());

  void include(const Vec3& place) noexcept {
    low = low.cwiseMin(place);
    high = high.cwiseMax(place);
  }
  void include(const Box& other) noexcept {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
  /// [m^2] 0 inside.
  [[nodiscard]] double squared_distance(const Vec3& at) const noexcept {
    return (low - at).cwiseMax(at - high).cwiseMax(0.0).squaredNorm();
  }
};

/// A tree of boxes over many items, which finds those near a place or in a region. Built off the
/// servo thread, then immutable.
class BoxTree {
 public:
  /// Puts the items into the order of the leaves: so they have to stay.
  /// @param boxes  one for each of the items, 1 to 2^31
  template <class T>
  BoxTree(std::span<const Box> boxes, std::vector<T>& items) {
    std::vector<T> sorted;
    sorted.reserve(items.size());
    for (const std::uint32_t number : build(boxes)) sorted.push_back(items[number]);
    items = std::move(sorted);
  }

  [[nodiscard]] const Box& bounds() const noexcept { return nodes_.front().box; }

  /// Visits ranges [first, end) of items, near ones first, until no box is nearer than what was
  /// found or `most_boxes` have been looked at.
  /// @param least  [m^2] squared distance beyond which nothing is looked for; `visit` reduces it
  /// [servo] No allocation, bounded.
  template <class Visit>
  void nearest(const Vec3& at, int most_boxes, double& least, const Visit& visit) const noexcept {
    Stack stack{};
    std::size_t size = 1;
    for (int box = 0; size > 0 && box < most_boxes; ++box) {
      const Node& node = nodes_[stack[--size]];
      if (node.box.squared_distance(at) >= least) continue;
      if (node.count > 0) {
        visit(node.first, node.first + node.count);
        continue;
      }
      const bool swap = nodes_[node.first].box.squared_distance(at) <
                        nodes_[node.first + 1].box.squared_distance(at);
      stack[size++] = node.first + (swap ? 1 : 0);  // the nearer one on top
      stack[size++] = node.first + (swap ? 0 : 1);
    }
  }

  /// Visits ranges [first, end) of items of all boxes that `meets` does not rule out.
  template <class Meets, class Visit>
  void walk(const Meets& meets, const Visit& visit) const {
    Stack stack{};
    for (std::size_t size = 1; size > 0;) {
      const Node& node = nodes_[stack[--size]];
      if (!meets(node.box)) continue;
      if (node.count > 0) {
        visit(node.first, node.first + node.count);
        continue;
      }
      stack[size++] = node.first;
      stack[size++] = node.first + 1;
    }
  }

 private:
  static constexpr std::size_t deepest = 40;  // halves, so 2^31 items are 31 deep
  using Stack = std::array<std::uint32_t, deepest>;
  struct Node {
    Box box;
    std::uint32_t first = 0;  // child or item
    std::uint32_t count = 0;  // of items; 0: the children are `first` and `first` + 1
  };
  struct Item {
    std::array<float, 3> centre;
    std::uint32_t number;
  };

  /// @return the items' numbers in the order of the leaves
  std::vector<std::uint32_t> build(std::span<const Box> boxes);
  void build(std::uint32_t node, std::span<Item> items, std::uint32_t first,
             std::span<const Box> boxes);

  std::vector<Node> nodes_;
};

}  // namespace palpate
