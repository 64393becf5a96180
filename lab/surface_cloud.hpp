// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "palpate/cloud/point_cloud.hpp"

namespace palpate::lab {

/// What may be known of points besides where they are; what is empty is not known.
struct Surface {
  std::vector<Vec3> points;                             ///< [m] world
  int columns = 0, rows = 0;                            ///< of points in the order of an image
  std::vector<Vec3> normals;                            ///< [-] of each point, outward
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< indices; counter-clockwise from outside
  std::vector<float> brightness;                        ///< [-] 0 to 1, of each point
};

/// A cloud for methods that ask for more than points near a place.
class SurfaceCloud final : public Cloud {
 public:
  /// @param viewpoint  [m] world: from where it was seen, if known
  explicit SurfaceCloud(Surface surface, std::optional<Vec3> viewpoint = std::nullopt)
      : cloud_(surface.points, viewpoint), surface_(std::move(surface)) {}

  void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept override {
    cloud_.gather(ball, max_points, patch);
  }
  void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept override {
    cloud_.gather(beam, max_points, patch);
  }
  [[nodiscard]] const Surface& surface() const { return surface_; }
  [[nodiscard]] const std::optional<Vec3>& viewpoint() const { return cloud_.viewpoint(); }

 private:
  PointCloud cloud_;
  Surface surface_;
};

}  // namespace palpate::lab
