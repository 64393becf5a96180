// SPDX-License-Identifier: Apache-2.0
#include "app/scripted_hand.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate::app {
namespace {

// The median depth of a few pixels about (u, v) [m].
std::optional<double> depth_at(const DepthImage& image, int u, int v) {
  constexpr int half = 3;
  std::vector<std::uint16_t> near;
  const Intrinsics& k = image.intrinsics();
  for (int y = std::max(v - half, 0); y <= std::min(v + half, k.height - 1); ++y) {
    for (int x = std::max(u - half, 0); x <= std::min(u + half, k.width - 1); ++x) {
      const std::uint16_t raw = image.depth()[static_cast<std::size_t>(y * k.width + x)];
      if (is_measured(raw)) near.push_back(raw);
    }
  }
  if (near.empty()) return std::nullopt;
  const auto middle = near.begin() + static_cast<std::ptrdiff_t>(near.size() / 2);
  std::nth_element(near.begin(), middle, near.end());
  return *middle / image.units_per_metre();
}

}  // namespace

HipPath scripted_hand(const DepthImage& image, double duration, double press) {
  const Intrinsics& k = image.intrinsics();
  constexpr double hover = 0.05;       // [m] in front of the surface, before and after
  constexpr double approach = 1.0;     // [s] to come down, and to go up
  constexpr double interval = 0.01;    // [s] between samples
  constexpr double circle_time = 4.0;  // [s]
  const double radius = k.height / 6.0;

  std::optional<double> depth = depth_at(image, k.width / 2, k.height / 2);
  if (!depth)
    throw Error("scripted hand", "the middle of the first frame measures nothing to touch",
                "give a path with --device script:FILE.csv");
  double smooth = *depth;
  std::vector<HipPath::Sample> samples;
  for (int i = 0; i * interval <= duration; ++i) {
    const double t = i * interval;
    const double stroke = std::clamp(t - approach, 0.0, std::max(duration - 2 * approach, 0.0));
    const double angle = 2.0 * std::numbers::pi * stroke / circle_time;
    const int u = k.width / 2 + static_cast<int>(radius * std::sin(angle));
    const int v = k.height / 2 + static_cast<int>(radius * (std::cos(angle) - 1.0));
    if (const auto measured = depth_at(image, u, v)) depth = measured;
    smooth += 0.2 * (*depth - smooth);  // a hand does not jump at an edge
    const double into =
        std::min({1.0, t / approach, (duration - t) / approach});  // 0 hovering, 1 pressing
    const double reach = smooth - hover + into * (hover + press);
    const Eigen::Vector2d ray = image.rays().ray(u, v);
    samples.push_back(
        {t, image.world_from_camera() * Vec3(reach * ray.x(), reach * ray.y(), reach)});
  }
  return HipPath(std::move(samples));
}

}  // namespace palpate::app
