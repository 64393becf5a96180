// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/cloud/point_cloud.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include <Eigen/Geometry>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

// A number along each axis takes 16 bits of a point's 48-bit place on the curve.
constexpr double cells = 1 << 16;
// Boxes that meet a search, at most; a power of two. A search of more of them stops at larger ones.
constexpr std::size_t most_runs = 256;
constexpr std::size_t points_in_leaf = 16;
// Of a beam's points so many times are looked at as are wanted: its boxes hold points beside it.
constexpr std::size_t looked_at_per_wanted = 4;

// Two zeros between each two of the lower 16 bits.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 32U) & 0x001f'0000'0000'ffffULL;
  bits = (bits | bits << 16U) & 0x001f'0000'ff00'00ffULL;
  bits = (bits | bits << 8U) & 0x100f'00f0'0f00'f00fULL;
  bits = (bits | bits << 4U) & 0x10c3'0c30'c30c'30c3ULL;
  return (bits | bits << 2U) & 0x1249'2492'4924'9249ULL;
}

struct Place {
  std::uint64_t on_curve;
  std::uint32_t point;
};

// By radix, 12 bits at a time; equal ones keep their order.
void sort(std::vector<Place>& places) {
  std::vector<Place> sorted(places.size());
  for (unsigned shift = 0; shift < 48; shift += 12) {
    const auto digit = [&](const Place& place) { return place.on_curve >> shift & 0xfffU; };
    std::array<std::uint32_t, 0x1000> next{};
    for (const Place& place : places) ++next[digit(place)];
    std::exclusive_scan(next.begin(), next.end(), next.begin(), 0U);
    for (const Place& place : places) sorted[next[digit(place)]++] = place;
    places.swap(sorted);
  }
}

void push(const Vec3& p, Patch& patch) {
  patch.push(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
}

void push_if_inside(const Vec3& point, const Ball& ball, Patch& patch) {
  const Vec3 p = point - ball.centre;
  if (p.squaredNorm() <= ball.radius * ball.radius) push(p, patch);
}

const Surface& checked(const Surface& surface) {
  const std::size_t count = surface.points.size();
  if (!surface.normals.empty() && surface.normals.size() != count)
    throw Error("surface", "the number of normals differs from the number of points",
                "give one for each");
  const auto image = static_cast<std::int64_t>(surface.columns) * surface.rows;
  if (image != 0 && image != static_cast<std::int64_t>(count))
    throw Error("surface", "the number of points is not columns times rows",
                "set every point, missing ones to NaN");
  for (const auto& triangle : surface.triangles) {
    if (*std::max_element(triangle.begin(), triangle.end()) >= count)
      throw Error("surface", "a triangle has an invalid vertex number", "number them from 0");
  }
  return surface;
}

// The points of a surface and, where it has faces, further ones on these: as many for each area, at
// the places of a sequence that spreads evenly however many there are (R2, Roberts 2018).
std::vector<Vec3> points_and_faces(const Surface& surface) {
  constexpr double finest = 1.5e-3;  // [m] between points: the usual proxy has 40 below it
  constexpr double most = 1 << 18;   // points; on larger meshes they lie farther apart
  constexpr double step_a = 0.7548776662466927, step_b = 0.5698402909980532;
  const auto sides = [&](const std::array<std::uint32_t, 3>& corners) {
    const Vec3& p = surface.points[corners[0]];
    return std::pair<Vec3, Vec3>(surface.points[corners[1]] - p, surface.points[corners[2]] - p);
  };
  const auto area_of = [](const std::pair<Vec3, Vec3>& side) {
    const double area = 0.5 * side.first.cross(side.second).norm();
    return std::isfinite(area) ? area : 0.0;
  };
  double area = 0.0;
  for (const auto& corners : surface.triangles) area += area_of(sides(corners));
  const double per_area = std::min(1.0 / (finest * finest), most / area);
  std::vector<Vec3> points = surface.points;
  double wanted = 0.0;
  double placed = 0.0;
  for (const auto& corners : surface.triangles) {
    const auto side = sides(corners);
    for (wanted += area_of(side) * per_area; placed + 1.0 <= wanted; placed += 1.0) {
      double a = std::fmod(0.5 + placed * step_a, 1.0);
      double b = std::fmod(0.5 + placed * step_b, 1.0);
      if (a + b > 1.0) {
        a = 1.0 - a;
        b = 1.0 - b;
      }
      points.emplace_back(surface.points[corners[0]] + a * side.first + b * side.second);
    }
  }
  return points;
}

}  // namespace

// Of those boxes of one level of the tree that meet a search: runs of `length` points each.
struct PointCloud::Runs {
  std::array<std::uint32_t, most_runs> number;  // the run begins at number * length
  std::size_t count;
  std::size_t length;
};

PointCloud::PointCloud(std::span<const Vec3> points, std::optional<Vec3> viewpoint)
    : viewpoint_(viewpoint) {
  if (points.size() > std::numeric_limits<std::uint32_t>::max()) {
    throw Error("point cloud",
                std::to_string(points.size()) + " points are more than can be numbered",
                "split it");
  }
  Box all;
  std::vector<Place> places;
  places.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) continue;
    all.low = all.low.cwiseMin(points[i]);
    all.high = all.high.cwiseMax(points[i]);
    places.push_back({0, static_cast<std::uint32_t>(i)});
  }
  non_finite_ = points.size() - places.size();
  if (places.empty()) return;
  // The extent of finite coordinates can overflow; halves cannot.
  const double half_extent = (0.5 * all.high - 0.5 * all.low).maxCoeff();
  // Points so near each other that this overflows are in one cell.
  double cells_per_half = (cells - 1.0) / half_extent;
  if (!std::isfinite(cells_per_half)) cells_per_half = 0.0;
  for (Place& place : places) {
    const Vec3 cell = (0.5 * points[place.point] - 0.5 * all.low) * cells_per_half;
    place.on_curve = spread(static_cast<std::uint64_t>(cell.x())) |
                     spread(static_cast<std::uint64_t>(cell.y())) << 1U |
                     spread(static_cast<std::uint64_t>(cell.z())) << 2U;
  }
  sort(places);

  points_.reserve(places.size());
  const std::size_t leaves = std::bit_ceil((places.size() + points_in_leaf - 1) / points_in_leaf);
  boxes_.resize(2 * leaves);
  for (const Place& place : places) {
    const Vec3& point = points[place.point];
    Box& leaf = boxes_[leaves + points_.size() / points_in_leaf];
    leaf.low = leaf.low.cwiseMin(point);
    leaf.high = leaf.high.cwiseMax(point);
    points_.push_back(point);
  }
  for (std::size_t k = leaves - 1; k > 0; --k) {
    boxes_[k].low = boxes_[2 * k].low.cwiseMin(boxes_[2 * k + 1].low);
    boxes_[k].high = boxes_[2 * k].high.cwiseMax(boxes_[2 * k + 1].high);
  }
}

PointCloud::PointCloud(Surface surface, std::optional<Vec3> viewpoint)
    : PointCloud(std::span<const Vec3>(points_and_faces(checked(surface))), viewpoint) {
  surface_ = std::make_shared<const Surface>(std::move(surface));
}

// Goes down level by level, while the boxes that `touches` says to meet the search are not too
// many.
template <class Touches>
PointCloud::Runs PointCloud::runs_where(const Touches& touches) const noexcept {
  Runs runs{{0}, 1, boxes_.size() / 2 * points_in_leaf};
  for (std::size_t first = 2; first < boxes_.size(); first *= 2) {
    Runs halves;
    halves.count = 0;
    halves.length = runs.length / 2;
    for (std::size_t i = 0; i < 2 * runs.count; ++i) {
      const std::size_t number = 2 * std::size_t{runs.number[i / 2]} + i % 2;
      if (!touches(boxes_[first + number])) continue;
      if (halves.count == most_runs) return runs;
      halves.number[halves.count++] = static_cast<std::uint32_t>(number);
    }
    runs = halves;
  }
  return runs;
}

// Every `stride`-th point of the runs, one after the other.
template <class Visit>
void PointCloud::for_each_point(const Runs& runs, std::size_t stride,
                                const Visit& visit) const noexcept {
  std::size_t ahead = 0;
  for (std::size_t run = 0; run < runs.count; ++run) {
    const std::size_t begin = runs.number[run] * runs.length;
    const std::size_t end = std::min(begin + runs.length, points_.size());
    std::size_t i = begin + ahead;
    for (; i < end; i += stride) visit(points_[i]);
    ahead = i - end;
  }
}

void PointCloud::gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept {
  patch.start_view(viewpoint_);
  if (points_.empty()) return;
  const double squared_radius = ball.radius * ball.radius;
  const Runs runs = runs_where([&](const Box& box) {
    const Vec3 away = (box.low - ball.centre).cwiseMax(ball.centre - box.high);
    return away.cwiseMax(0.0).squaredNorm() <= squared_radius;
  });
  const std::size_t stride = runs.count * runs.length / std::max<std::size_t>(max_points, 1) + 1;
  if (stride > 1) patch.mark_thinned(1.0 / static_cast<double>(stride));
  for_each_point(runs, stride, [&](const Vec3& point) { push_if_inside(point, ball, patch); });
}

void PointCloud::gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept {
  patch.start_view(viewpoint_);
  if (points_.empty()) return;
  const SightCone cone(beam, viewpoint_);
  const Runs runs = runs_where([&](const Box& box) {
    if (box.low.x() > box.high.x()) return false;
    const double radius = (0.5 * box.high - 0.5 * box.low).norm();
    return cone.meets(0.5 * box.low + 0.5 * box.high - beam.through, radius);
  });
  const std::size_t wanted = std::max<std::size_t>(max_points, 1);
  const std::size_t looked_at_stride =
      runs.count * runs.length / (looked_at_per_wanted * wanted) + 1;
  std::size_t inside = 0;
  for_each_point(runs, looked_at_stride, [&](const Vec3& point) {
    if (cone.holds(point - beam.through)) ++inside;
  });
  const std::size_t stride = inside / wanted + 1;
  if (looked_at_stride * stride > 1)
    patch.mark_thinned(1.0 / static_cast<double>(looked_at_stride * stride));
  std::size_t next = 0;
  for_each_point(runs, looked_at_stride, [&](const Vec3& point) {
    const Vec3 p = point - beam.through;
    if (cone.holds(p) && next++ % stride == 0) push(p, patch);
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
    throw Error("set of clouds", std::to_string(clouds_.size()) + " clouds are too many",
                "give at most " + std::to_string(Patch::max_views));
  }
  for (std::size_t i = 0; i < clouds_.size(); ++i) {
    if (!clouds_[i]) throw Error("set of clouds", "one of them is missing", "leave it out");
    take(i, *clouds_[i]);
  }
}

}  // namespace palpate
