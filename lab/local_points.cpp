// SPDX-License-Identifier: Apache-2.0
#include "lab/local_points.hpp"

#include <iterator>
#include <utility>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/linear.hpp"

namespace palpate::lab {

LocalPoints::LocalPoints(double reach, std::size_t window) : reach_(reach), window_(window) {}

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
  points_.clear();
  normals_.clear();
  const PointCloud* given = window_ == 1 ? cloud_->point_cloud() : nullptr;
  const Surface* surface = given != nullptr ? given->surface() : nullptr;
  if (surface != nullptr && !surface->normals.empty()) {
    viewpoint_ = given->viewpoint();
    for (std::size_t i = 0; i < surface->points.size(); ++i) {
      if (!((surface->points[i] - place).norm() <= reach_)) continue;
      points_.push_back(surface->points[i]);
      normals_.push_back(surface->normals[i]);
    }
  } else {
    gather(*cloud_, Ball{place, reach_}, patch_);
    for (std::size_t i = 0; i < patch_.size(); ++i)
      newest_.emplace_back(place + Vec3(patch_.x()[i], patch_.y()[i], patch_.z()[i]));
    viewpoint_ = patch_.view_count() > 0 ? patch_.view(0).viewpoint : std::nullopt;
    points_ = newest_;
    for (const std::vector<Vec3>& frame : before_)
      std::copy_if(frame.begin(), frame.end(), std::back_inserter(points_),
                   [&](const Vec3& point) { return (point - place).norm() <= reach_; });
  }
  tree_ = points_.empty() ? nullptr : std::make_unique<KdTree>(points_);
  return true;
}

void LocalPoints::within(const Vec3& at, double radius, std::vector<Neighbour>& found) const {
  found.clear();
  if (tree_ != nullptr) tree_->within(at, radius, found);
}

void LocalPoints::nearest(const Vec3& at, std::size_t count, std::vector<Neighbour>& found) const {
  found.clear();
  if (tree_ != nullptr) tree_->nearest(at, count, found);
}

std::optional<Contact> fit_plane(const Patch& patch, double radius) {
  double total = 0.0;
  Vec3 mean = Vec3::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const Vec3 x(patch.x()[i], patch.y()[i], patch.z()[i]);
    const double q = std::max(1.0 - x.norm() / radius, 0.0);
    const double w = q * q * q * q * (4.0 * (1.0 - q) + 1.0);  // Wendland's C2 function
    total += w;
    mean += w * x;
    second += w * x * x.transpose();
  }
  if (patch.size() < 6 || !(total > 1e-12)) return std::nullopt;
  mean /= total;
  Vec3 normal = axes_of(second / total - mean * mean.transpose()).vectors.col(0);
  const Vec3 at = patch.ball().centre + mean;
  if (normal.dot(towards_viewer(patch.view(0).viewpoint, at)) < 0.0) normal = -normal;
  return Contact{at, normal};
}

}  // namespace palpate::lab
