// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// [-] depth over width of a surface between neighbouring pixels: a slope of 70 degrees.
inline constexpr double steepest_surface = 2.75;

/// Depth [m] of the background beside pixel (u, v), if it is farther than the pixel's own z [m] by
/// more than a side's `jump` [m]; infinite if nothing is seen there.
template <class DepthAt>
std::optional<double> seen_past(const Intrinsics& k, const DepthAt& depth_at, int u, int v,
                                double z, double jump, int stride) noexcept {
  // Largest hole that an edge search crosses: stereo cameras leave a shadow beside near objects.
  constexpr int widest_hole = 16;   // [px]
  constexpr double steepest = 2.0;  // [-] depth over width of a surface that continues past a hole
  const auto beside = [&](int du, int dv) {
    const double pitch = z * (du != 0 ? 1.0 / k.fx : 1.0 / k.fy) * stride;
    for (int i = 1; i <= widest_hole; ++i) {
      const int x = u + i * du * stride;
      const int y = v + i * dv * stride;
      if (x < 0 || y < 0 || x >= k.width || y >= k.height) return z;
      const double there = depth_at(x, y);
      if (there == 0.0) continue;
      return there > z + jump + steepest * pitch * (i - 1) ? there : z;
    }
    return std::numeric_limits<double>::infinity();
  };
  const double end = std::max({beside(1, 0), beside(-1, 0), beside(0, 1), beside(0, -1)});
  return end > z ? std::optional(end) : std::nullopt;
}

/// Adds points of a ball on the sides of bodies, as `Cloud::gather_sides` says, with other depths
/// than the image's own.
/// @param depth_at  double(int u, int v): [m] of a pixel within the image; 0: nothing was measured
template <class DepthAt>
void gather_sides(const DepthImage& image, const DepthAt& depth_at, const Ball& ball,
                  const Sides& sides, std::size_t max_points, Patch& patch) noexcept {
  const Eigen::Matrix3d rotation = image.world_from_camera().linear();
  const Vec3 centre =
      rotation.transpose() * (ball.centre - image.world_from_camera().translation());
  if (!(centre.z() > ball.radius)) return;
  const ViewingRays::Window window = image.rays().window(centre, ball.radius);
  if (window.empty()) return;
  const Intrinsics& k = image.intrinsics();
  const int stride = window.stride(max_points);
  const auto on_grid = [stride](int first) { return (first + stride - 1) / stride * stride; };
  const double nearest = centre.z() - ball.radius;
  const double farthest = centre.z() + ball.radius;
  for (int v = on_grid(window.v_begin); v < window.v_end; v += stride) {
    for (int u = on_grid(window.u_begin); u < window.u_end; u += stride) {
      const double z = depth_at(u, v);
      if (z == 0.0 || z > farthest || z + sides.depth < nearest) continue;
      const double pitch = z / k.fx * stride;
      const std::optional<double> past =
          seen_past(k, depth_at, u, v, z, std::max(sides.jump, steepest_surface * pitch), stride);
      if (!past) continue;
      const Eigen::Vector2d ray = image.rays().ray(u, v);
      if (!ray.allFinite()) continue;
      const double end = std::min({*past, z + sides.depth, farthest});
      for (int i = std::max(1, static_cast<int>((nearest - z) / pitch)); z + i * pitch < end; ++i) {
        const double at = z + i * pitch;
        const Vec3 p = Vec3(at * ray.x(), at * ray.y(), at) - centre;
        if (p.squaredNorm() > ball.radius * ball.radius) continue;
        const Vec3 q = rotation * p;
        patch.push(static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z()));
      }
    }
  }
}

/// Adds points of a ball between an image's pixels, as `Cloud::gather_sheet` says, with other
/// depths than the image's own. Each pixel is a tile, which reaches half way to its neighbours:
/// bilinear between those that are of the same surface, and going on as it is where they are not.
/// @param depth_at  double(int u, int v): [m] of a pixel within the image; 0: nothing was measured
template <class DepthAt>
void gather_sheet(const DepthImage& image, const DepthAt& depth_at, const Ball& ball,
                  const Sheet& sheet, std::size_t max_points, Patch& patch) noexcept {
  constexpr int most_parts = 12;  // of a tile, along either side
  const Eigen::Matrix3d rotation = image.world_from_camera().linear();
  const Vec3 centre =
      rotation.transpose() * (ball.centre - image.world_from_camera().translation());
  const Intrinsics& k = image.intrinsics();
  const double pitch = centre.z() / std::min(k.fx, k.fy);
  if (!(pitch > sheet.spacing) || !(centre.z() > ball.radius + pitch)) return;
  const ViewingRays::Window window = image.rays().window(centre, ball.radius + pitch);
  if (window.empty() || window.stride(max_points) > 1) return;
  const double jump = std::max(sheet.jump, steepest_surface * pitch);

  // What a pixel saw, in the camera's axes relative to the ball's centre; none of another surface.
  struct Seen {
    Vec3 p;
    double z;
    bool same;
  };
  const auto look = [&](int u, int v, double z_here) -> Seen {
    if (u < 0 || v < 0 || u >= k.width || v >= k.height) return {Vec3::Zero(), 0.0, false};
    const double z = depth_at(u, v);
    const Eigen::Vector2d ray = image.rays().ray(u, v);
    return {Vec3(z * ray.x(), z * ray.y(), z) - centre, z,
            z > 0.0 && ray.allFinite() && std::abs(z - z_here) <= jump};
  };
  const double squared_radius = ball.radius * ball.radius;
  for (int v = window.v_begin; v < window.v_end; ++v) {
    for (int u = window.u_begin; u < window.u_end; ++u) {
      const double z = depth_at(u, v);
      const Seen here = look(u, v, z);
      if (!here.same || std::abs(z - centre.z()) > ball.radius + jump) continue;
      std::array<Seen, 9> around;  // by rows
      for (int i = 0; i < 9; ++i) {
        around[static_cast<std::size_t>(i)] = look(u + i % 3 - 1, v + i / 3 - 1, z);
      }
      // From the pixel to its four neighbours. Towards another surface it continues as on the other
      // side; without either, across the line of sight.
      const auto step = [&](std::size_t to, std::size_t from, const Vec3& across) -> Vec3 {
        if (around[to].same) return around[to].p - here.p;
        return around[from].same ? Vec3(here.p - around[from].p) : across;
      };
      const Vec3 right = step(5, 3, Vec3(z / k.fx, 0.0, 0.0));
      const Vec3 left = step(3, 5, Vec3(-z / k.fx, 0.0, 0.0));
      const Vec3 down = step(7, 1, Vec3(0.0, z / k.fy, 0.0));
      const Vec3 up = step(1, 7, Vec3(0.0, -z / k.fy, 0.0));
      const auto parts = [&](const Vec3& a, const Vec3& b) {
        const double length = 0.5 * (a.norm() + b.norm());
        return std::clamp(static_cast<int>(std::ceil(length / sheet.spacing)), 1, most_parts);
      };
      const int columns = parts(left, right);
      const int rows = parts(up, down);
      for (int j = 0; j < rows; ++j) {
        const double b = (j + 0.5) / rows - 0.5;
        for (int i = 0; i < columns; ++i) {
          const double a = (i + 0.5) / columns - 0.5;
          if (a == 0.0 && b == 0.0) continue;  // the pixel itself
          const Vec3& along = a < 0.0 ? left : right;
          const Vec3& across = b < 0.0 ? up : down;
          const Seen& corner =
              around[static_cast<std::size_t>((b < 0.0 ? 0 : 6) + (a < 0.0 ? 0 : 2))];
          const double s = std::abs(a);
          const double t = std::abs(b);
          Vec3 p = here.p + s * along + t * across;
          if (corner.same) p += s * t * (corner.p - here.p - along - across);
          if (p.squaredNorm() > squared_radius) continue;
          const Vec3 q = rotation * p;
          patch.push(static_cast<float>(q.x()), static_cast<float>(q.y()),
                     static_cast<float>(q.z()));
        }
      }
    }
  }
}

}  // namespace palpate
