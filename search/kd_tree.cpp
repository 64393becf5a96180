// SPDX-License-Identifier: Apache-2.0
#include "search/kd_tree.hpp"

#include <utility>

#include <nanoflann.hpp>

namespace palpate {
namespace {

struct PointList {
  const std::vector<Vec3>* points;

  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points->size(); }
  [[nodiscard]] double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return (*points)[i][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointList>,
                                                  PointList, 3, std::uint32_t>;

// nanoflann 1.5 renamed both.
#if NANOFLANN_VERSION >= 0x150
using Search = nanoflann::SearchParameters;
using Found = nanoflann::ResultItem<std::uint32_t, double>;
#else
using Search = nanoflann::SearchParams;
using Found = std::pair<std::uint32_t, double>;
#endif

}  // namespace

struct KdTree::Tree {
  PointList list;
  Index index;
  std::vector<Found> found;
  std::vector<std::uint32_t> indices;
  std::vector<double> squares;

  explicit Tree(const std::vector<Vec3>& points)
      : list{&points}, index(3, list, nanoflann::KDTreeSingleIndexAdaptorParams(10)) {
    index.buildIndex();
  }
};

KdTree::KdTree(const std::vector<Vec3>& points) : tree_(std::make_unique<Tree>(points)) {}
KdTree::~KdTree() = default;

std::size_t KdTree::search(const Ball& ball) {
  Search unsorted;
  unsorted.sorted = false;
  return tree_->index.radiusSearch(ball.centre.data(), ball.radius * ball.radius, tree_->found,
                                   unsorted);
}

void KdTree::within(const Vec3& at, double radius, std::vector<Neighbour>& found) {
  found.clear();
  search(Ball{at, radius});
  for (const auto& [index, squared] : tree_->found) found.push_back({index, squared});
}

void KdTree::nearest(const Vec3& at, std::size_t count, std::vector<Neighbour>& found) {
  found.clear();
  tree_->indices.resize(count);
  tree_->squares.resize(count);
  const std::size_t there =
      tree_->index.knnSearch(at.data(), count, tree_->indices.data(), tree_->squares.data());
  for (std::size_t i = 0; i < there; ++i) found.push_back({tree_->indices[i], tree_->squares[i]});
}

}  // namespace palpate
