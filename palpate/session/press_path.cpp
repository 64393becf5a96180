// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/press_path.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/core/pose.hpp"

namespace palpate {
namespace {

constexpr double interval = 0.01;  // [s] between samples of a slide

std::string name_of(Pixel pixel) {
  return "pixel " + std::to_string(pixel.u) + "," + std::to_string(pixel.v);
}

bool contains(const Intrinsics& k, Pixel pixel) {
  return pixel.u >= 0 && pixel.u < k.width && pixel.v >= 0 && pixel.v < k.height;
}

// The measured pixel nearest to one; none in an image of holes.
std::optional<Pixel> nearest_measured(const DepthImage& image, Pixel pixel) {
  const Intrinsics& k = image.intrinsics();
  std::optional<Pixel> nearest;
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const std::int64_t du = u - pixel.u;
      const std::int64_t dv = v - pixel.v;
      if (du * du + dv * dv >= least || !image.deproject(u, v)) continue;
      least = du * du + dv * dv;
      nearest = Pixel{u, v};
    }
  }
  return nearest;
}

void check(const char* name, double value, double min, double max, const char* unit) {
  if (value >= min && value <= max) return;
  throw Error(name, shortest(value) + " " + unit + " is out of range",
              "give " + shortest(min) + " to " + shortest(max) + " " + unit);
}

// The point `behind` [m] the depth along the ray of a pixel's coordinates, which may lie between
// pixels.
Vec3 behind_surface(const DepthImage& image, Eigen::Vector2d ray, double depth, double behind) {
  const Vec3 direction(ray.x(), ray.y(), 1.0);
  const Vec3 in_camera = depth * direction + behind * direction.normalized();
  return image.world_from_camera() * in_camera;
}

}  // namespace

Pixel parse_pixel(std::string_view text, const std::string& subject) {
  Pixel pixel;
  const char* const end = text.data() + text.size();
  const auto column = std::from_chars(text.data(), end, pixel.u);
  const bool comma = column.ec == std::errc{} && column.ptr != end && *column.ptr == ',';
  const auto row = comma ? std::from_chars(column.ptr + 1, end, pixel.v) : column;
  if (!comma || row.ec != std::errc{} || row.ptr != end) {
    throw Error(subject, "'" + std::string(text) + "' is not a pixel",
                "give column and row, such as 320,240");
  }
  return pixel;
}

std::optional<double> median_depth(const DepthImage& image, Pixel pixel) noexcept {
  constexpr int half = 3;
  const Intrinsics& k = image.intrinsics();
  std::array<std::uint16_t, (2 * half + 1) * (2 * half + 1)> near{};
  std::size_t count = 0;
  for (int v = std::max(pixel.v - half, 0); v <= std::min(pixel.v + half, k.height - 1); ++v) {
    for (int u = std::max(pixel.u - half, 0); u <= std::min(pixel.u + half, k.width - 1); ++u) {
      const auto place = static_cast<std::size_t>(v) * static_cast<std::size_t>(k.width) +
                         static_cast<std::size_t>(u);
      const std::uint16_t raw = image.depth()[place];
      if (is_measured(raw)) near[count++] = raw;
    }
  }
  if (count == 0) return std::nullopt;
  auto* const middle = near.data() + count / 2;
  std::nth_element(near.data(), middle, near.data() + count);
  return *middle / image.units_per_metre();
}

Vec3 surface_at(const DepthImage& image, Pixel pixel) {
  const Intrinsics& k = image.intrinsics();
  if (!contains(k, pixel)) {
    throw Error(name_of(pixel), "it lies outside the image",
                "give a column from 0 to " + std::to_string(k.width - 1) + " and a row from 0 to " +
                    std::to_string(k.height - 1));
  }
  const auto depth = median_depth(image, pixel);
  const Eigen::Vector2d ray = image.rays().ray(pixel.u, pixel.v);
  if (!depth || !ray.allFinite()) {
    const auto near = nearest_measured(image, pixel);
    throw Error(name_of(pixel), "nothing was measured there",
                near ? "the nearest measured pixel is " + std::to_string(near->u) + "," +
                           std::to_string(near->v)
                     : "the whole frame is empty: check the camera");
  }
  return behind_surface(image, ray, *depth, 0.0);
}

HipPath press_path(const DepthImage& image, Pixel at, const PressOptions& options, double start) {
  check("press depth", options.depth, 0.0, 0.1, "m");
  check("press speed", options.speed, 1e-3, 2.0, "m/s");
  check("press approach", options.approach, 1e-3, 1.0, "m");
  check("press hold", options.hold, 0.0, 60.0, "s");
  surface_at(image, at);
  const Eigen::Vector2d first_ray = image.rays().ray(at.u, at.v);
  double depth = *median_depth(image, at);
  std::vector<HipPath::Sample> samples;
  double t = start;
  const auto add = [&](double after, const Vec3& hip) {
    t += after;
    if (samples.empty() || after > 0.0) samples.push_back({t, hip});
  };
  const double down = (options.approach + options.depth) / options.speed;
  add(0.0, behind_surface(image, first_ray, depth, -options.approach));
  add(down, behind_surface(image, first_ray, depth, options.depth));
  add(options.hold, samples.back().hip);
  Eigen::Vector2d ray = first_ray;
  if (const auto& to = options.slide_to) {
    const Vec3 from_point = surface_at(image, at);
    const Vec3 to_point = surface_at(image, *to);
    const int steps = std::max(
        1, static_cast<int>(std::ceil((to_point - from_point).norm() / options.speed / interval)));
    for (int i = 1; i <= steps; ++i) {
      const double share = static_cast<double>(i) / steps;
      const double u = at.u + share * (to->u - at.u);
      const double v = at.v + share * (to->v - at.v);
      const Pixel pixel{static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v))};
      const Eigen::Vector2d pixel_ray = image.rays().ray(pixel.u, pixel.v);
      if (pixel_ray.allFinite()) {
        // Between two pixels: a ray that moves on smoothly.
        const Intrinsics& k = image.intrinsics();
        ray = pixel_ray + Eigen::Vector2d((u - pixel.u) / k.fx, (v - pixel.v) / k.fy);
        depth = median_depth(image, pixel).value_or(depth);
      }
      const Vec3 next = behind_surface(image, ray, depth, options.depth);
      // Over a step of the surface the path takes as long as its speed asks for.
      add(std::max(interval, (next - samples.back().hip).norm() / options.speed), next);
    }
    add(options.hold, samples.back().hip);
  }
  add(down, behind_surface(image, ray, depth, -options.approach));
  return HipPath(std::move(samples));
}

}  // namespace palpate
