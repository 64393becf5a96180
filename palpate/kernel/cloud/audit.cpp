// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/cloud/audit.hpp"

#include <algorithm>
#include <array>

namespace palpate {

std::optional<double> distance_behind(const DepthImage& image, const Vec3& point,
                                      double radius) noexcept {
  constexpr int most_per_side = 32;
  std::array<std::uint16_t, most_per_side * most_per_side> readings;

  const Vec3 at = image.world_from_camera().linear().transpose() *
                  (point - image.world_from_camera().translation());
  if (!(at.z() > radius)) return std::nullopt;
  const ViewingRays::Window window = image.rays().window(at, radius);
  if (window.empty()) return std::nullopt;
  const int columns = window.u_end - window.u_begin;
  const int rows = window.v_end - window.v_begin;
  const int stride = (std::max(columns, rows) + most_per_side - 1) / most_per_side;
  const auto width = static_cast<std::size_t>(image.intrinsics().width);

  std::size_t looked_at = 0;
  std::size_t measured = 0;
  for (int v = window.v_begin; v < window.v_end; v += stride) {
    for (int u = window.u_begin; u < window.u_end; u += stride) {
      ++looked_at;
      const std::uint16_t raw =
          image.depth()[static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u)];
      if (is_measured(raw)) readings[measured++] = raw;
    }
  }
  if (measured == 0 || 2 * measured < looked_at) return std::nullopt;
  auto* middle = readings.data() + measured / 2;
  std::nth_element(readings.data(), middle, readings.data() + measured);
  return at.z() - *middle / image.units_per_metre();
}

}  // namespace palpate
