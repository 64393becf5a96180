// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/cloud/proposed_touch.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace palpate {
namespace {

constexpr double radius_per_spacing = 1.2;  // [-] r_c, of a proxy that points so far apart carry
constexpr double largest_radius = 0.024;    // [m] r_c whose r_3 is within its range
constexpr double fewest_across = 4.0;       // points along a surface: fewer are none
constexpr double handy = 0.5;               // [m] long things are felt well
constexpr double shortest_felt = 0.02;      // [m] long: four times the usual r_c

// Of a point, the spacing of a square grid of as many neighbours in the circle that reaches to the
// last of them; 0: it has too few. Only neighbours along the curve are looked at.
double spacing_about(const PointCloud& cloud, std::size_t point) {
  constexpr std::size_t neighbours = 8;
  constexpr std::size_t looked_at = 64;  // to each side
  std::vector<double> squares;           // [m^2]
  const std::size_t end = std::min(point + looked_at + 1, cloud.size());
  for (std::size_t i = point - std::min(point, looked_at); i < end; ++i) {
    if (i > 0 && cloud.point(i) == cloud.point(i - 1)) continue;  // given twice
    const double square = (cloud.point(i) - cloud.point(point)).squaredNorm();
    if (square > 0.0) squares.push_back(square);
  }
  if (squares.size() < neighbours) return 0.0;
  const auto last = squares.begin() + (neighbours - 1);
  std::nth_element(squares.begin(), last, squares.end());
  return std::sqrt(std::numbers::pi * *last / neighbours);
}

}  // namespace

ProposedTouch proposed_touch(const PointCloud& cloud) {
  constexpr std::size_t sample = 512;
  const double usual = ProxyParameters{}.r_c();
  ProposedTouch proposed;
  proposed.radius = usual;
  if (cloud.size() == 0) return proposed;
  Vec3 low = cloud.point(0);
  Vec3 high = low;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    low = low.cwiseMin(cloud.point(i));
    high = high.cwiseMax(cloud.point(i));
  }
  proposed.extent = (high - low).maxCoeff();
  std::vector<double> spacings;
  for (std::size_t i = 0; i < cloud.size(); i += cloud.size() / sample + 1) {
    if (const double spacing = spacing_about(cloud, i); spacing > 0.0) spacings.push_back(spacing);
  }
  if (spacings.empty()) return proposed;
  const auto middle = spacings.begin() + static_cast<std::ptrdiff_t>(spacings.size() / 2);
  std::nth_element(spacings.begin(), middle, spacings.end());
  if (!std::isfinite(proposed.extent) || proposed.extent < fewest_across * *middle) return proposed;
  proposed.spacing = *middle;
  const auto is_too_sparse = [&] {
    return radius_per_spacing * proposed.scale * proposed.spacing > largest_radius;
  };
  if (!is_too_sparse()) proposed.radius = std::max(usual, radius_per_spacing * proposed.spacing);
  if (is_too_sparse() || proposed.extent < shortest_felt)
    proposed.scale = std::pow(10.0, std::round(std::log10(handy / proposed.extent)));
  while (is_too_sparse()) proposed.scale /= 10.0;
  return proposed;
}

Parameters for_points(Parameters parameters, std::span<const Cloud* const> seen) {
  if (parameters.proxy.r_c() != ProxyParameters{}.r_c()) return parameters;
  double radius = 0.0;  // [m]
  for (const Cloud* cloud : seen) {
    const auto* points = dynamic_cast<const PointCloud*>(cloud);
    if (points == nullptr) return parameters;
    radius = std::max(radius, proposed_touch(*points).radius);
  }
  if (radius > parameters.proxy.r_c()) set_parameter(parameters, "r_c", radius);
  return parameters;
}

}  // namespace palpate
