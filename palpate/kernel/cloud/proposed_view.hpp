// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"

namespace palpate {

/// A pinhole camera of 640 x 480 pixels that nobody has: it gives points without an image pixels.
struct ProposedView {
  std::shared_ptr<const ViewingRays> rays;
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();  ///< optical frame
};

/// A view of the whole cloud: from the sensor's side, at the cloud's viewpoint (the origin, where
/// it knows none), if all of it lies before that; else from a corner outside, its flat side down.
/// O(points). @throws Error for a cloud without points.
ProposedView proposed_view(const PointCloud& cloud);

/// What a view shows of a cloud: the foremost point of each pixel, drawn as large as the gaps
/// between points are.
class SeenPoints {
 public:
  /// O(points).
  SeenPoints(const ProposedView& view, const PointCloud& cloud);

  /// Number of the point that pixel (u, v) shows; none: nothing is there.
  [[nodiscard]] std::optional<std::size_t> at(int u, int v) const;
  /// The same as an image of depth.
  [[nodiscard]] DepthImage image() const;

 private:
  static constexpr std::uint32_t none = 0xffffffff;
  ProposedView view_;
  std::vector<std::uint32_t> point_;  // row by row
  std::vector<float> depth_;          // [m] along the optical axis
};

}  // namespace palpate
