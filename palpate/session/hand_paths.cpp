// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/hand_paths.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/session/press.hpp"

namespace palpate {
HipPath stroke_path(const DepthImage& image, double duration, double press) {
  const Intrinsics& k = image.intrinsics();
  constexpr double hover = 0.05;       // [m] in front of the surface, before and after
  constexpr double clearance = 0.02;   // [m] in front of what it is lifted over
  constexpr double approach = 1.0;     // [s] to come down, and to go up
  constexpr double lift = 0.3;         // [s] to be lifted, and as long before an edge
  constexpr double edge = 0.004;       // [m] between two samples
  constexpr double interval = 0.01;    // [s] between samples
  constexpr double circle_time = 4.0;  // [s]
  const double radius = k.height / 6.0;

  std::optional<double> depth = median_depth(image, {k.width / 2, k.height / 2});
  if (!depth)
    throw Error("built-in hand", "the middle of the first frame measures nothing to touch",
                "give a path with --device script:FILE.csv");
  struct Place {
    Eigen::Vector2d ray;
    double depth;
    bool flat;  // measured, and no edge since the place before
  };
  std::vector<Place> places;
  for (int i = 0; i * interval <= duration; ++i) {
    const double stroke =
        std::clamp(i * interval - approach, 0.0, std::max(duration - 2 * approach, 0.0));
    const double angle = 2.0 * std::numbers::pi * stroke / circle_time;
    const int u = k.width / 2 + static_cast<int>(radius * std::sin(angle));
    const int v = k.height / 2 + static_cast<int>(radius * (std::cos(angle) - 1.0));
    const std::optional<double> measured = median_depth(image, {u, v});
    const bool flat = measured && std::abs(*measured - *depth) < edge;
    if (measured) depth = measured;
    places.push_back({image.rays().ray(u, v), *depth, flat});
  }

  // Where a camera sees an edge there is often a shadow behind it, and nothing to touch.
  const int ahead = static_cast<int>(lift / interval);
  const int count = static_cast<int>(places.size());
  std::vector<HipPath::Sample> samples;
  double surface = places.front().depth;
  double down = 1.0;  // 0 lifted, 1 pressing
  for (int i = 0; i < count; ++i) {
    double nearest = places[static_cast<std::size_t>(i)].depth;
    bool flat = true;
    for (int j = std::max(i - ahead, 0); j < std::min(i + 2 * ahead, count); ++j) {
      nearest = std::min(nearest, places[static_cast<std::size_t>(j)].depth);
      flat = flat && places[static_cast<std::size_t>(j)].flat;
    }
    const double target = flat ? places[static_cast<std::size_t>(i)].depth : nearest;
    surface += 0.2 * (target - surface);  // a hand does not jump
    down = std::clamp(down + (flat ? 1.0 : -1.0) * interval / lift, 0.0, 1.0);
    const double t = i * interval;
    const double into = std::min({1.0, t / approach, (duration - t) / approach});
    const double reach = surface - hover + into * (hover - clearance + down * (clearance + press));
    const Place& place = places[static_cast<std::size_t>(i)];
    samples.push_back(
        {t, image.world_from_camera() * (reach * Vec3(place.ray.x(), place.ray.y(), 1.0))});
  }
  return HipPath(std::move(samples));
}

Vec3 hover_place(const Cloud& cloud) {
  constexpr double hover = 0.05;  // [m]
  if (const DepthImage* image = cloud.image()) {
    const Intrinsics& k = image->intrinsics();
    Vec3 camera = image->world_from_camera().translation();
    // Outwards from the middle until something was measured.
    for (int ring = 0; ring < k.width / 2; ++ring) {
      for (const int side : {-1, 1}) {
        const auto point = image->deproject(k.width / 2 + side * ring, k.height / 2);
        if (point) return *point + hover * (camera - *point).normalized();
      }
    }
    return camera;
  }
  const PointCloud* points = cloud.point_cloud();
  if (points == nullptr || points->size() == 0) return Vec3::Zero();
  Vec3 middle = Vec3::Zero();
  for (std::size_t i = 0; i < points->size(); ++i) middle += points->point(i);
  middle /= static_cast<double>(points->size());
  Vec3 nearest = points->point(0);
  for (std::size_t i = 1; i < points->size(); ++i) {
    const Vec3& point = points->point(i);
    if ((point - middle).squaredNorm() < (nearest - middle).squaredNorm()) nearest = point;
  }
  const Vec3 from = points->viewpoint().value_or(Vec3::Zero());
  const Vec3 away = from - nearest;
  return nearest + hover * (away.norm() > 1e-3 ? away.normalized() : Vec3::UnitZ());
}

}  // namespace palpate
