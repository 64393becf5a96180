// SPDX-License-Identifier: Apache-2.0
#include "lab/local_points.hpp"

#include <utility>

#include <nanoflann.hpp>

#include "palpate/cloud/point_cloud.hpp"

namespace palpate::lab {
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

struct LocalPoints::Tree {
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

LocalPoints::LocalPoints(double reach, std::size_t window) : reach_(reach), window_(window) {}
LocalPoints::~LocalPoints() = default;

void LocalPoints::frame(const Cloud& cloud) {
  if (window_ > 1 && !newest_.empty()) {
    before_.push_front(std::move(newest_));
    while (before_.size() >= window_) before_.pop_back();
  }
  newest_.clear();
  cloud_ = &cloud;
  stale_ = true;
}

bool LocalPoints::cover(const Vec3& place) {
  if (cloud_ == nullptr) return false;
  if (!stale_ && (place - centre_).norm() <= reach_ / 3.0) return false;
  stale_ = false;
  centre_ = place;
  newest_.clear();
  normals_.clear();
  const auto* given = dynamic_cast<const PointCloud*>(cloud_);
  if (window_ == 1 && given != nullptr && given->surface() != nullptr &&
      !given->surface()->normals.empty()) {
    const Surface& surface = *given->surface();
    viewpoint_ = given->viewpoint();
    points_.clear();
    for (std::size_t i = 0; i < surface.points.size(); ++i) {
      if (!((surface.points[i] - place).norm() <= reach_)) continue;
      points_.push_back(surface.points[i]);
      normals_.push_back(surface.normals[i]);
    }
    tree_ = points_.empty() ? nullptr : std::make_unique<Tree>(points_);
    return true;
  }
  gather(*cloud_, Ball{place, reach_}, patch_);
  for (std::size_t i = 0; i < patch_.size(); ++i)
    newest_.emplace_back(place + Vec3(patch_.x()[i], patch_.y()[i], patch_.z()[i]));
  viewpoint_ = patch_.view_count() > 0 ? patch_.view(0).viewpoint : std::nullopt;
  points_ = newest_;
  for (const std::vector<Vec3>& frame : before_) {
    for (const Vec3& point : frame) {
      if ((point - place).norm() <= reach_) points_.push_back(point);
    }
  }
  tree_ = points_.empty() ? nullptr : std::make_unique<Tree>(points_);
  return true;
}

void LocalPoints::within(const Vec3& at, double radius, std::vector<Neighbour>& found) const {
  found.clear();
  if (tree_ == nullptr) return;
  Search unsorted;
  unsorted.sorted = false;
  tree_->index.radiusSearch(at.data(), radius * radius, tree_->found, unsorted);
  for (const auto& [index, squared] : tree_->found) found.push_back({index, squared});
}

void LocalPoints::nearest(const Vec3& at, std::size_t count, std::vector<Neighbour>& found) const {
  found.clear();
  if (tree_ == nullptr) return;
  tree_->indices.resize(count);
  tree_->squares.resize(count);
  const std::size_t there =
      tree_->index.knnSearch(at.data(), count, tree_->indices.data(), tree_->squares.data());
  for (std::size_t i = 0; i < there; ++i) found.push_back({tree_->indices[i], tree_->squares[i]});
}

}  // namespace palpate::lab
