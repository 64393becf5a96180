// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "palpate/core/patch.hpp"

namespace palpate::bench {

/// What one would take otherwise: nanoflann's k-d tree over all points of a frame.
class KdTree {
 public:
  explicit KdTree(const std::vector<Vec3>& points);
  ~KdTree();
  KdTree(const KdTree&) = delete;
  KdTree& operator=(const KdTree&) = delete;
  KdTree(KdTree&&) = delete;
  KdTree& operator=(KdTree&&) = delete;

  /// How many points lie within the ball; they are kept until the next search.
  std::size_t search(const Ball& ball);

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace palpate::bench
