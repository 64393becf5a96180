// SPDX-License-Identifier: Apache-2.0
#include "palpate/cloud/point_cloud.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

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

void push(const Vec3& p, Patch& patch) {
  patch.push(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
}

void push_if_inside(const Vec3& point, const Ball& ball, Patch& patch) {
  const Vec3 p = point - ball.centre;
  if (p.squaredNorm() <= ball.radius * ball.radius) push(p, patch);
}

// Numbers the voxels in the order in which they are met.
class VoxelNumbers {
 public:
  std::uint32_t number_of(std::uint64_t key) {
    // Neighbours in a file are neighbours in space, mostly.
    if (!keys_.empty() && key == keys_[last_]) return last_;
    if (2 * (keys_.size() + 1) > slots_.size()) grow();
    std::size_t slot = slot_of(key, slots_.size());
    while (slots_[slot] != none && keys_[slots_[slot]] != key)
      slot = (slot + 1) & (slots_.size() - 1);
    if (slots_[slot] == none) {
      slots_[slot] = static_cast<std::uint32_t>(keys_.size());
      keys_.push_back(key);
    }
    last_ = slots_[slot];
    return last_;
  }
  [[nodiscard]] const std::vector<std::uint64_t>& keys() const { return keys_; }
  /// For each slot of a table that is at most half full, the number of its voxel or `none`.
  [[nodiscard]] const std::vector<std::uint32_t>& slots() const { return slots_; }

  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

 private:
  void grow() {
    slots_.assign(2 * slots_.size(), none);
    for (std::uint32_t number = 0; number < keys_.size(); ++number) {
      std::size_t slot = slot_of(keys_[number], slots_.size());
      while (slots_[slot] != none) slot = (slot + 1) & (slots_.size() - 1);
      slots_[slot] = number;
    }
  }

  std::vector<std::uint64_t> keys_;
  std::vector<std::uint32_t> slots_ = std::vector<std::uint32_t>(16, none);
  std::uint32_t last_ = 0;
};

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

  // Number the voxels, give each its run of points, then put the points in their runs.
  VoxelNumbers voxels;
  std::vector<std::uint32_t> voxel_of;
  voxel_of.reserve(finite);
  std::vector<std::uint32_t> next;  // per voxel: how many points; then where its next one goes
  for (const Vec3& p : points) {
    if (!p.allFinite()) continue;
    const std::uint32_t number = voxels.number_of(voxel_key(p));
    if (number == next.size()) next.push_back(0);
    ++next[number];
    voxel_of.push_back(number);
  }
  cells_.assign(voxels.slots().size(), Cell{0, 0, 0});
  std::uint32_t total = 0;
  for (std::size_t slot = 0; slot < cells_.size(); ++slot) {
    const std::uint32_t number = voxels.slots()[slot];
    if (number == VoxelNumbers::none) continue;
    const std::uint32_t count = next[number];
    cells_[slot] = {voxels.keys()[number], total, total + count};
    next[number] = total;
    total += count;
  }
  x_.resize(finite);
  y_.resize(finite);
  z_.resize(finite);
  auto number = voxel_of.begin();
  for (const Vec3& p : points) {
    if (!p.allFinite()) continue;
    const std::size_t i = next[*number++]++;
    x_[i] = p.x();
    y_[i] = p.y();
    z_[i] = p.z();
  }
}

PointCloud::PointCloud(Surface surface, std::optional<Vec3> viewpoint, double voxel)
    : PointCloud(std::span<const Vec3>(surface.points), viewpoint, voxel) {
  const std::size_t count = surface.points.size();
  if (!surface.normals.empty() && surface.normals.size() != count)
    throw Error("surface", "its normals are not as many as its points", "give one for each");
  const auto image = static_cast<std::int64_t>(surface.columns) * surface.rows;
  if (image != 0 && image != static_cast<std::int64_t>(count))
    throw Error("surface", "its points are not columns times rows", "give each place one, or NaN");
  for (const auto& triangle : surface.triangles) {
    if (*std::max_element(triangle.begin(), triangle.end()) >= count)
      throw Error("surface", "a triangle's corner is none of its points", "number them from 0");
  }
  surface_ = std::make_shared<const Surface>(std::move(surface));
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

// The cells that meet the box from `low` to `high` [m, world].
template <class Visit>
void PointCloud::for_each_cell(const Vec3& low, const Vec3& high,
                               const Visit& visit) const noexcept {
  Index first{};
  Index last{};
  for (int axis = 0; axis < 3; ++axis) {
    const double from = std::max(low[axis] - corner_[axis], 0.0);
    const double to = std::min(high[axis] - corner_[axis], extent_[axis]);
    if (!(from <= to)) return;
    first[axis] = static_cast<std::int64_t>(from / voxel_);
    last[axis] = static_cast<std::int64_t>(to / voxel_);
  }
  for (std::int64_t k = first[2]; k <= last[2]; ++k) {
    for (std::int64_t j = first[1]; j <= last[1]; ++j) {
      for (std::int64_t i = first[0]; i <= last[0]; ++i) {
        if (const Cell* cell = find(key_of(i, j, k))) visit(*cell);
      }
    }
  }
}

template <class Visit>
void PointCloud::for_each_cell(const Ball& ball, const Visit& visit) const noexcept {
  const Vec3 half = Vec3::Constant(ball.radius);
  for_each_cell(Vec3(ball.centre - half), Vec3(ball.centre + half), visit);
}

// Layer of voxels by layer of voxels along the axis that the beam follows most: in each, the cells
// of the box around its piece of the beam. Layers are visited once, whatever the direction.
template <class Visit>
void PointCloud::for_each_cell(const Beam& beam, const SightCone& cone,
                               const Visit& visit) const noexcept {
  const Vec3& direction = cone.axis();
  int along = 0;
  direction.cwiseAbs().maxCoeff(&along);
  const double slope = std::abs(direction[along]);
  const double widest = std::max(cone.radius_at(cone.reach()), cone.radius_at(-cone.reach()));
  const double half_length = cone.reach() * slope + widest;
  const double centre = beam.through[along] - corner_[along];
  const double from = std::max(centre - half_length, 0.0);
  const double to = std::min(centre + half_length, extent_[along]);
  if (!(from <= to)) return;
  const auto last = static_cast<std::int64_t>(to / voxel_);
  for (auto layer = static_cast<std::int64_t>(from / voxel_); layer <= last; ++layer) {
    // Points of the cone whose coordinate `along` lies in this layer, give or take its radius.
    const double middle = ((static_cast<double>(layer) + 0.5) * voxel_ - centre) / direction[along];
    const double half_piece = (0.5 * voxel_ + widest) / slope;
    const double radius =
        std::max(cone.radius_at(middle - half_piece), cone.radius_at(middle + half_piece));
    if (radius <= 0.0) continue;
    const Vec3 at = beam.through + middle * direction;
    // To the side, a cone that leans moves by at most half a piece times its lean.
    Vec3 half = (direction.cwiseAbs() * half_piece).array() + radius;
    half[along] = 0.0;
    Vec3 low = at - half;
    Vec3 high = at + half;
    low[along] = high[along] = corner_[along] + (static_cast<double>(layer) + 0.5) * voxel_;
    // The last layer's middle may lie beyond the last point.
    low[along] = high[along] = std::min(low[along], corner_[along] + extent_[along]);
    for_each_cell(low, high, visit);
  }
}

void PointCloud::gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept {
  patch.start_view(viewpoint_);
  if (x_.empty()) return;
  std::size_t candidates = 0;
  for_each_cell(ball, [&](const Cell& cell) { candidates += cell.end - cell.begin; });
  const std::size_t stride = candidates / std::max<std::size_t>(max_points, 1) + 1;
  if (stride > 1) patch.mark_thinned(1.0 / static_cast<double>(stride));
  for_each_cell(ball, [&](const Cell& cell) {
    for (std::size_t i = cell.begin; i < cell.end; i += stride) {
      push_if_inside(point(i), ball, patch);
    }
  });
}

void PointCloud::gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept {
  patch.start_view(viewpoint_);
  if (x_.empty()) return;
  const SightCone cone(beam, viewpoint_);
  std::size_t inside = 0;
  for_each_cell(beam, cone, [&](const Cell& cell) {
    for (std::size_t i = cell.begin; i < cell.end; ++i) {
      if (cone.holds(point(i) - beam.through)) ++inside;
    }
  });
  const std::size_t stride = inside / std::max<std::size_t>(max_points, 1) + 1;
  if (stride > 1) patch.mark_thinned(1.0 / static_cast<double>(stride));
  std::size_t next = 0;
  for_each_cell(beam, cone, [&](const Cell& cell) {
    for (std::size_t i = cell.begin; i < cell.end; ++i) {
      const Vec3 p = point(i) - beam.through;
      if (cone.holds(p) && next++ % stride == 0) push(p, patch);
    }
  });
}

void BruteForceCloud::gather(const Ball& ball, std::size_t /*max_points*/,
                             Patch& patch) const noexcept {
  patch.start_view(viewpoint_);
  for (const Vec3& p : points_) push_if_inside(p, ball, patch);
}

void BruteForceCloud::gather(const Beam& beam, std::size_t /*max_points*/,
                             Patch& patch) const noexcept {
  patch.start_view(viewpoint_);
  const SightCone cone(beam, viewpoint_);
  for (const Vec3& point : points_) {
    const Vec3 p = point - beam.through;
    if (cone.holds(p)) push(p, patch);
  }
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

void CloudSet::gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept {
  for (const auto& cloud : clouds_) cloud->gather(beam, max_points / clouds_.size(), patch);
}

void CloudSet::gather_sides(const Ball& ball, const Sides& sides, std::size_t max_points,
                            Patch& patch) const noexcept {
  for (const auto& cloud : clouds_)
    cloud->gather_sides(ball, sides, max_points / clouds_.size(), patch);
}

void CloudSet::gather_sheet(const Ball& ball, const Sheet& sheet, std::size_t max_points,
                            Patch& patch) const noexcept {
  for (const auto& cloud : clouds_)
    cloud->gather_sheet(ball, sheet, max_points / clouds_.size(), patch);
}

void CloudSet::gather_of(std::string_view material, const Ball& ball, std::size_t max_points,
                         Patch& patch) const noexcept {
  for (const auto& cloud : clouds_)
    cloud->gather_of(material, ball, max_points / clouds_.size(), patch);
}

bool CloudSet::has_materials() const noexcept {
  return std::any_of(clouds_.begin(), clouds_.end(),
                     [](const auto& cloud) { return cloud->has_materials(); });
}

bool CloudSet::has_brightness() const noexcept {
  return std::any_of(clouds_.begin(), clouds_.end(),
                     [](const auto& cloud) { return cloud->has_brightness(); });
}

void CloudSet::sample(const Vec3& place, const Vec3& normal, double radius,
                      SurfaceSample& sample) const noexcept {
  for (const auto& cloud : clouds_) cloud->sample(place, normal, radius, sample);
}

double CloudSet::spacing(const Vec3& place) const noexcept {
  double least = 0.0;
  for (const auto& cloud : clouds_) {
    const double spacing = cloud->spacing(place);
    if (spacing > 0.0 && (least == 0.0 || spacing < least)) least = spacing;
  }
  return least;
}

}  // namespace palpate
