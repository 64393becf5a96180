// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/cloud/pixel_probe.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/linear.hpp"

namespace palpate {
namespace {

constexpr std::array<int, 4> radii{3, 5, 10, 20};  // [px] tried for the normal, smallest first
constexpr int fewest_points = 6;                   // twice what a plane needs
constexpr double flatness = 0.3;  // [-] rms distance from the plane to rms extent in it, at most
// Points this much nearer or farther than the pixel's own belong to another surface: metres, or a
// share of its distance, whichever is more.
constexpr double least_gate = 0.005;
constexpr double gate_share = 0.02;

void check_pixel(int u, int v, int width, int height) {
  if (u >= 0 && u < width && v >= 0 && v < height) return;
  throw Error(
      "pixel " + std::to_string(u) + "," + std::to_string(v),
      "is outside the image of " + std::to_string(width) + "x" + std::to_string(height) + " pixels",
      "give a column from 0 to " + std::to_string(width - 1) + " and a row from 0 to " +
          std::to_string(height - 1));
}

// The normal of points near `centre` in the square of `radius` around (u, v), towards `eye`.
template <class PointAt>
std::optional<Vec3> normal_at(const PointAt& point_at, int u, int v, int radius, const Vec3& centre,
                              const Vec3& eye) {
  const double distance = (centre - eye).norm();
  const double gate = std::max(least_gate, gate_share * distance);
  Vec3 sum = Vec3::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  int count = 0;
  for (int j = v - radius; j <= v + radius; ++j) {
    for (int i = u - radius; i <= u + radius; ++i) {
      const std::optional<Vec3> point = point_at(i, j);
      if (!point) continue;
      if (std::abs((*point - eye).norm() - distance) > gate) continue;
      const Vec3 offset = *point - centre;
      sum += offset;
      squares += offset * offset.transpose();
      ++count;
    }
  }
  if (count < fewest_points) return std::nullopt;
  const Vec3 mean = sum / count;
  const Axes axes = axes_of(squares / count - mean * mean.transpose());
  const Eigen::Vector3d spread = axes.values.cwiseMax(0.0).cwiseSqrt();
  if (!(spread[1] > 0.0) || spread[0] > flatness * spread[1]) return std::nullopt;
  const Vec3 normal = axes.vectors.col(0);
  return normal.dot(eye - centre) < 0.0 ? Vec3(-normal) : normal;
}

template <class PointAt>
PixelProbe probe(const PointAt& point_at, int u, int v, int width, int height, const Vec3& eye) {
  check_pixel(u, v, width, height);
  PixelProbe result;
  constexpr int around = PixelProbe::neighbourhood;
  for (int j = std::max(v - around, 0); j <= std::min(v + around, height - 1); ++j) {
    for (int i = std::max(u - around, 0); i <= std::min(u + around, width - 1); ++i) {
      if (i == u && j == v) continue;
      ++result.neighbours;
      result.measured += point_at(i, j) ? 1 : 0;
    }
  }
  result.in_world = point_at(u, v);
  if (!result.in_world) return result;
  for (const int radius : radii) {
    result.normal = normal_at(point_at, u, v, radius, *result.in_world, eye);
    result.normal_radius = result.normal ? radius : 0;
    if (result.normal) break;
  }
  return result;
}

}  // namespace

PixelProbe probe_pixel(const DepthImage& image, int u, int v) {
  const Intrinsics& k = image.intrinsics();
  const Eigen::Isometry3d& world_from_camera = image.world_from_camera();
  PixelProbe result = probe([&](int i, int j) { return image.deproject(i, j); }, u, v, k.width,
                            k.height, world_from_camera.translation());
  if (result.in_world) {
    result.in_camera = world_from_camera.inverse() * *result.in_world;
    result.depth = result.in_camera->z();
  }
  return result;
}

PixelProbe probe_pixel(const PointCloud& cloud, int u, int v) {
  const Surface* surface = cloud.surface();
  if (surface == nullptr || surface->columns <= 0)
    throw Error("point cloud", "it has no pixels", "give a depth image or an organised cloud");
  const int width = surface->columns;
  const int height = surface->rows;
  const auto point_at = [&](int i, int j) -> std::optional<Vec3> {
    if (i < 0 || i >= width || j < 0 || j >= height) return std::nullopt;
    const Vec3& point = surface->points[static_cast<std::size_t>(j) * width + i];
    return point.allFinite() ? std::optional(point) : std::nullopt;
  };
  return probe(point_at, u, v, width, height, cloud.viewpoint().value_or(Vec3::Zero()));
}

}  // namespace palpate
