// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/cloud/proposed_view.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr int view_width = 640, view_height = 480;  // [px]
constexpr double filled = 0.95;                     // [-] of the image, by the cloud
const double widest = std::tan(1.2);                // [-] of the angle from the axis, about 69 deg
const double outside = std::tan(0.35);              // [-] of half the image's height, from a corner
constexpr int largest_dot = 10;                     // [px] half the side of a point's square

// A camera at `eye` that looks along `forward` with `up` upwards.
Eigen::Isometry3d looking(const Vec3& eye, const Vec3& forward, const Vec3& up) {
  const Vec3 z = forward.normalized();
  const Vec3 x = z.cross(up).normalized();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() << x, z.cross(x), z;
  pose.translation() = eye;
  return pose;
}

// How far the cloud reaches from the axis of a view: |x| / z and |y| / z; infinite behind it.
Eigen::Vector2d reach_of(const PointCloud& cloud, const Eigen::Isometry3d& world_from_camera) {
  const Eigen::Isometry3d camera_from_world = world_from_camera.inverse();
  Eigen::Vector2d reach = Eigen::Vector2d::Constant(1e-3);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3 p = camera_from_world * cloud.point(i);
    if (!(p.z() > 0.0)) return Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
    reach = reach.cwiseMax(p.head<2>().cwiseAbs() / p.z());
  }
  return reach;
}

ProposedView view_from(const Eigen::Isometry3d& pose, const Eigen::Vector2d& reach) {
  Intrinsics k;
  k.width = view_width;
  k.height = view_height;
  k.cx = 0.5 * (view_width - 1);
  k.cy = 0.5 * (view_height - 1);
  k.fx = k.fy = filled * std::min(k.cx / reach.x(), k.cy / reach.y());
  return {std::make_shared<const ViewingRays>(k), pose};
}

}  // namespace

ProposedView proposed_view(const PointCloud& cloud) {
  if (cloud.size() == 0)
    throw Error("point cloud", "it has no points", "give a file with at least one");
  Vec3 low = cloud.point(0);
  Vec3 high = low;
  const Vec3 eye = cloud.viewpoint().value_or(Vec3::Zero());
  Vec3 forward = Vec3::Zero();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3& p = cloud.point(i);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    if (const Vec3 away = p - eye; away.squaredNorm() > 0.0) forward += away.normalized();
  }
  if (forward.norm() > 0.0) {
    // A sensor's own frame has y down; where it looks aside, z is up in the world.
    const bool own_frame = std::abs(forward.normalized().z()) > 0.8;
    const Vec3 up = own_frame ? Vec3(-Vec3::UnitY()) : Vec3(Vec3::UnitZ());
    const Eigen::Isometry3d pose = looking(eye, forward, up);
    const Eigen::Vector2d reach = reach_of(cloud, pose);
    if (reach.maxCoeff() < widest) return view_from(pose, reach);
  }
  const Vec3 side = high - low;
  const bool is_level = side.z() <= std::max(side.x(), side.y());
  const Vec3 back = (is_level ? Vec3(0.6, -0.9, 0.7) : Vec3(0.6, 0.5, 1.0)).normalized();
  const Vec3 up = is_level ? Vec3::UnitZ() : Vec3::UnitY();
  // The ball about the cloud's box is in the image from here.
  const double distance = std::max(0.5 * side.norm(), 1e-3) / std::sin(std::atan(outside));
  const Eigen::Isometry3d pose = looking(0.5 * (low + high) + distance * back, -back, up);
  return view_from(pose, reach_of(cloud, pose));
}

SeenPoints::SeenPoints(const ProposedView& view, const PointCloud& cloud)
    : view_(view),
      point_(static_cast<std::size_t>(view_width) * view_height, none),
      depth_(point_.size(), std::numeric_limits<float>::infinity()) {
  const Intrinsics& k = view.rays->intrinsics();
  const Eigen::Isometry3d camera_from_world = view.world_from_camera.inverse();
  const double gap = std::sqrt(static_cast<double>(point_.size()) /
                               static_cast<double>(std::max<std::size_t>(cloud.size(), 1)));
  const int half = std::clamp(static_cast<int>(std::lround(0.5 * gap)), 0, largest_dot);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3 p = camera_from_world * cloud.point(i);
    const double u = k.fx * p.x() / p.z() + k.cx;
    const double v = k.fy * p.y() / p.z() + k.cy;
    if (!(p.z() > 0.0 && u > -0.5 && u < k.width - 0.5 && v > -0.5 && v < k.height - 0.5)) continue;
    const int column = static_cast<int>(std::lround(u));
    const int row = static_cast<int>(std::lround(v));
    for (int y = std::max(row - half, 0); y <= std::min(row + half, k.height - 1); ++y) {
      for (int x = std::max(column - half, 0); x <= std::min(column + half, k.width - 1); ++x) {
        const auto at = static_cast<std::size_t>(y) * view_width + static_cast<std::size_t>(x);
        if (!(p.z() < depth_[at])) continue;
        depth_[at] = static_cast<float>(p.z());
        point_[at] = static_cast<std::uint32_t>(i);
      }
    }
  }
}

std::optional<std::size_t> SeenPoints::at(int u, int v) const {
  if (u < 0 || u >= view_width || v < 0 || v >= view_height) return std::nullopt;
  const std::uint32_t point =
      point_[static_cast<std::size_t>(v) * view_width + static_cast<std::size_t>(u)];
  return point == none ? std::nullopt : std::optional<std::size_t>(point);
}

DepthImage SeenPoints::image() const {
  constexpr double most = 65000.0;  // raw
  float farthest = 1e-6F;
  for (const float depth : depth_)
    farthest = std::isfinite(depth) ? std::max(farthest, depth) : farthest;
  const double units = most / static_cast<double>(farthest);
  std::vector<std::uint16_t> raw(depth_.size(), 0);
  for (std::size_t i = 0; i < raw.size(); ++i) {
    if (std::isfinite(depth_[i]))
      raw[i] = static_cast<std::uint16_t>(
          std::max(1L, std::lround(units * static_cast<double>(depth_[i]))));
  }
  return {view_.rays, std::move(raw), units, view_.world_from_camera};
}

}  // namespace palpate
