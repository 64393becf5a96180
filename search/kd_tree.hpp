// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// A k-d tree over a list of points: nanoflann's.
class KdTree {
 public:
  struct Neighbour {
    std::uint32_t index;
    double squared;  ///< [m^2] its distance
  };

  /// O(n log n). @param points  [m]; must outlive the tree, unchanged
  explicit KdTree(const std::vector<Vec3>& points);
  ~KdTree();
  KdTree(const KdTree&) = delete;
  KdTree& operator=(const KdTree&) = delete;

  /// How many points lie within the ball; they are kept until the next search.
  std::size_t search(const Ball& ball);
  /// The points within a distance [m], in no order.
  void within(const Vec3& at, double radius, std::vector<Neighbour>& found);
  /// The nearest `count` points, nearest first.
  void nearest(const Vec3& at, std::size_t count, std::vector<Neighbour>& found);

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace palpate
