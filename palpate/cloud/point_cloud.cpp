// SPDX-License-Identifier: Apache-2.0
#include "palpate/cloud/point_cloud.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

// A voxel's number along each axis takes 21 bits of its 64-bit key.
constexpr std::int64_t most_voxels = (1 << 21) - 1;

std::uint64_t key_of(std::int64_t i, std::int64_t j, std::int64_t k) {
  return static_cast<std::uint64_t>(i) | static_cast<std::uint64_t>(j) << 21U |
         static_cast<std::uint64_t>(k) << 42U;
}

// Fibonacci hashing: neighbouring voxels land far apart.
std::size_t slot_of(std::uint64_t key, std::size_t slots) {
  return (key * 0x9E3779B97F4A7C15ULL) >> (64U - static_cast<unsigned>(std::bit_width(slots) - 1));
}

void push_if_inside(const Vec3& point, const Ball& ball, Patch& patch) {
  const Vec3 p = point - ball.centre;
  if (p.squaredNorm() <= ball.radius * ball.radius) {
    patch.push(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
  }
}

}  // namespace

PointCloud::PointCloud(std::span<const Vec3> points, std::optional<Vec3> viewpoint, double voxel)
    : voxel_(voxel), viewpoint_(viewpoint) {
  if (!(voxel >= 1e-3 && voxel <= 1.0)) {
    throw Error("voxel size", std::to_string(voxel) + " m is not in 0.001 to 1 m",
                "give about the radius of a search, such as 0.01");
  }
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::max());
  Vec3 high = Vec3::Constant(std::numeric_limits<double>::lowest());
  std::size_t finite = 0;
  for (const Vec3& p : points) {
    if (!p.allFinite()) continue;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    ++finite;
  }
  non_finite_ = points.size() - finite;
  if (finite == 0) return;
  if (finite > std::numeric_limits<std::uint32_t>::max()) {
    throw Error("point cloud", std::to_string(finite) + " points are more than can be numbered",
                "split it");
  }
  corner_ = low;
  extent_ = high - low;
  // The extent of finite coordinates can still overflow; halves cannot.
  const double half_extent = (0.5 * high - 0.5 * low).maxCoeff();
  voxel_ = std::max(voxel_, 2.0 * (half_extent / static_cast<double>(most_voxels - 1)));

  const auto voxel_key = [this](const Vec3& p) {
    const Eigen::Array<double, 3, 1> index =
        ((p - corner_) / voxel_).array().min(static_cast<double>(most_voxels)).floor();
    return key_of(static_cast<std::int64_t>(index.x()), static_cast<std::int64_t>(index.y()),
                  static_cast<std::int64_t>(index.z()));
  };

  // Count the points of each voxel, give each voxel its run, then put the points in their runs.
  cells_.assign(std::bit_ceil(std::max<std::size_t>(2 * finite, 16)), Cell{0, 0, 0});
  const std::size_t slots = cells_.size();
  const auto cell_of = [this, slots](std::uint64_t key) -> Cell& {
    std::size_t slot = slot_of(key, slots);
    while (cells_[slot].end != 0 && cells_[slot].key != key) slot = (slot + 1) & (slots - 1);
    cells_[slot].key = key;
    return cells_[slot];
  };
  for (const Vec3& p : points) {
    if (p.allFinite()) ++cell_of(voxel_key(p)).end;
  }
  std::uint32_t total = 0;
  for (Cell& cell : cells_) {
    const std::uint32_t count = cell.end;
    cell.begin = total;
    total += count;
    cell.end = total;
  }
  x_.resize(finite);
  y_.resize(finite);
  z_.resize(finite);
  std::vector<std::uint32_t> filled(cells_.size(), 0);
  for (const Vec3& p : points) {
    if (!p.allFinite()) continue;
    const Cell* cell = find(voxel_key(p));
    const auto slot = static_cast<std::size_t>(cell - cells_.data());
    const std::size_t i = cell->begin + filled[slot]++;
    x_[i] = p.x();
    y_[i] = p.y();
    z_[i] = p.z();
  }
}

const PointCloud::Cell* PointCloud::find(std::uint64_t key) const noexcept {
  const std::size_t slots = cells_.size();
  std::size_t slot = slot_of(key, slots);
  // At most half of the slots are in use, so a probe ends at an empty one.
  while (cells_[slot].begin != cells_[slot].end) {
    if (cells_[slot].key == key) return &cells_[slot];
    slot = (slot + 1) & (slots - 1);
  }
  return nullptr;
}

template <class Visit>
void PointCloud::for_each_cell(const Ball& ball, const Visit& visit) const noexcept {
  const Vec3 centre = ball.centre - corner_;
  Index low{};
  Index high{};
  for (int axis = 0; axis < 3; ++axis) {
    const double from = std::max(centre[axis] - ball.radius, 0.0);
    const double to = std::min(centre[axis] + ball.radius, extent_[axis]);
    if (!(from <= to)) return;
    low[axis] = static_cast<std::int64_t>(from / voxel_);
    high[axis] = static_cast<std::int64_t>(to / voxel_);
  }
  for (std::int64_t k = low[2]; k <= high[2]; ++k) {
    for (std::int64_t j = low[1]; j <= high[1]; ++j) {
      for (std::int64_t i = low[0]; i <= high[0]; ++i) {
        if (const Cell* cell = find(key_of(i, j, k))) visit(*cell);
      }
    }
  }
}

void PointCloud::gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept {
  patch.start_view(viewpoint_);
  if (x_.empty()) return;
  std::size_t candidates = 0;
  for_each_cell(ball, [&](const Cell& cell) { candidates += cell.end - cell.begin; });
  const std::size_t stride = candidates / std::max<std::size_t>(max_points, 1) + 1;
  if (stride > 1) patch.mark_thinned();
  for_each_cell(ball, [&](const Cell& cell) {
    for (std::size_t i = cell.begin; i < cell.end; i += stride) {
      push_if_inside(point(i), ball, patch);
    }
  });
}

void BruteForceCloud::gather(const Ball& ball, std::size_t /*max_points*/,
                             Patch& patch) const noexcept {
  patch.start_view(viewpoint_);
  for (const Vec3& p : points_) push_if_inside(p, ball, patch);
}

CloudSet::CloudSet(std::vector<std::shared_ptr<const Cloud>> clouds) : clouds_(std::move(clouds)) {
  if (clouds_.size() > Patch::max_views) {
    throw Error("set of clouds",
                std::to_string(clouds_.size()) + " are more than can be touched at once",
                "give at most " + std::to_string(Patch::max_views));
  }
  for (const auto& cloud : clouds_) {
    if (!cloud) throw Error("set of clouds", "one of them is missing", "leave it out");
  }
}

void CloudSet::gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept {
  for (const auto& cloud : clouds_) cloud->gather(ball, max_points / clouds_.size(), patch);
}

}  // namespace palpate
