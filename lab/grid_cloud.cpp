// SPDX-License-Identifier: Apache-2.0
#include "lab/grid_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "palpate/io/sources/sensor_model.hpp"

namespace palpate::lab {
namespace {

// Adds white noise smoothed by a Gaussian to the heights of a grid: marginal deviation sigma,
// correlation exp(-(d / length)^2) at d points.
void add_correlated_noise(std::vector<Vec3>& points, int columns, int rows, double sigma,
                          double length, std::uint64_t key) {
  // A kernel exp(-2 (d / length)^2), convolved with itself, gives that correlation.
  const int half = static_cast<int>(std::ceil(1.5 * length));
  std::vector<float> kernel;
  float squares = 0.0F;
  for (int d = -half; d <= half; ++d) {
    const double at = d / length;
    kernel.push_back(static_cast<float>(math::exp(-2.0 * at * at)));
    squares += kernel.back() * kernel.back();
  }
  for (float& k : kernel) k /= std::sqrt(squares);

  const int wide = columns + 2 * half;
  const int tall = rows + 2 * half;
  std::vector<float> white(static_cast<std::size_t>(wide) * tall);
  fill_normal(key, white);
  std::vector<float> smoothed(static_cast<std::size_t>(columns) * tall);
  const auto convolved = [&](const std::vector<float>& values, std::size_t at, int step) {
    float sum = 0.0F;
    for (std::size_t d = 0; d < kernel.size(); ++d) sum += kernel[d] * values[at + d * step];
    return sum;
  };
  for (std::size_t v = 0; v < static_cast<std::size_t>(tall); ++v) {
    for (int u = 0; u < columns; ++u) smoothed[v * columns + u] = convolved(white, v * wide + u, 1);
  }
  for (std::size_t i = 0; i < points.size(); ++i)
    points[i].z() += sigma * double{convolved(smoothed, i, columns)};
}

}  // namespace

std::unique_ptr<PointCloud> GridCloud::capture(std::uint64_t frame, double lift) const {
  const auto first = [this](double half) { return static_cast<int>(std::ceil(-half / spacing)); };
  const auto count = [this](double half) { return static_cast<int>(2.0 * half / spacing) + 1; };
  const int columns = count(half_x);
  const int rows = count(half_y);
  const int i0 = first(half_x);
  const int j0 = first(half_y);
  Surface surface;
  surface.columns = columns;
  surface.rows = rows;
  std::vector<Vec3>& points = surface.points;
  points.reserve(static_cast<std::size_t>(columns) * rows);
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const double x = (i0 + i) * spacing;
      const double y = (j0 + j) * spacing;
      points.emplace_back(x, y, height(x, y) + lift);
    }
  }
  // From the differences to the neighbours, one-sided at the border.
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const auto z = [&](int u, int v) {
        return points[static_cast<std::size_t>(std::clamp(v, 0, rows - 1)) * columns +
                      static_cast<std::size_t>(std::clamp(u, 0, columns - 1))];
      };
      const Vec3 along = z(i + 1, j) - z(i - 1, j);
      const Vec3 up = z(i, j + 1) - z(i, j - 1);
      const Vec3 normal = along.cross(up);
      surface.normals.push_back(normal.norm() > 0.0 ? Vec3(normal.normalized())
                                                    : Vec3(Vec3::UnitZ()));
    }
  }
  if (sigma > 0.0 && noise == Noise::white) add_point_noise(points, sigma, seed, frame);
  if (sigma > 0.0 && noise == Noise::correlated)
    add_correlated_noise(points, columns, rows, sigma, 5.0, seed * 0x9E3779B97F4A7C15ULL + frame);
  return std::make_unique<PointCloud>(std::move(surface), Vec3(0.0, 0.0, 10.0));
}

}  // namespace palpate::lab
