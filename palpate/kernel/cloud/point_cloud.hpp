// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "palpate/kernel/core/observed_clouds.hpp"

namespace palpate {

/// Points with further properties; an empty member is not known. Library methods use points alone.
struct Surface {
  std::vector<Vec3> points{};                             ///< [m] world
  int columns = 0, rows = 0;                              ///< of points in the order of an image
  std::vector<Vec3> normals{};                            ///< [-] of each point, outward; or zero
  std::vector<std::array<std::uint32_t, 3>> triangles{};  ///< counter-clockwise from outside
};

/// Points in no particular order: sorted once, on the camera's thread, along a space-filling curve,
/// below a balanced tree of boxes. A search looks at a bounded number of boxes and points, however
/// many there are.
class PointCloud final : public Cloud {
 public:
  /// O(points log points). Non-finite points are left out and counted.
  /// @param points     [m] world
  /// @param viewpoint  [m] world: from where they were seen (PCD's VIEWPOINT), if known
  /// @throws Error if there are more points than 32 bits can number.
  explicit PointCloud(std::span<const Vec3> points, std::optional<Vec3> viewpoint = std::nullopt);
  /// The same, keeping the further properties. On faces it lays points, 1.5 mm apart, at most 2^18.
  /// @throws Error also if normals, image or triangles do not fit the points.
  explicit PointCloud(Surface surface, std::optional<Vec3> viewpoint = std::nullopt);

  void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept override;
  void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept override;

  [[nodiscard]] const PointCloud* point_cloud() const noexcept override { return this; }
  /// All points as given, non-finite ones included, with their further properties; or null.
  [[nodiscard]] const Surface* surface() const noexcept { return surface_.get(); }

  [[nodiscard]] std::size_t size() const noexcept { return points_.size(); }
  /// How many points were left out because a coordinate was not finite.
  [[nodiscard]] std::size_t non_finite() const noexcept { return non_finite_; }
  /// The finite points, those on faces too, along the curve. A cloud of them has the same order.
  [[nodiscard]] const Vec3& point(std::size_t i) const noexcept { return points_[i]; }
  [[nodiscard]] const std::optional<Vec3>& viewpoint() const noexcept { return viewpoint_; }

 private:
  struct Box {
    Vec3 low = Vec3::Constant(std::numeric_limits<double>::max());
    Vec3 high = Vec3::Constant(std::numeric_limits<double>::lowest());
  };
  struct Runs;

  template <class Touches>
  [[nodiscard]] Runs runs_where(const Touches& touches) const noexcept;
  template <class Visit>
  void for_each_point(const Runs& runs, std::size_t stride, const Visit& visit) const noexcept;

  std::vector<Vec3> points_;  // [m] along the curve
  // Of a binary tree, the root at 1, the halves of k at 2 k and 2 k + 1. Each leaf has a run of
  // points; leaves beyond the last point have an empty box.
  std::vector<Box> boxes_;
  std::optional<Vec3> viewpoint_;
  std::size_t non_finite_ = 0;
  std::shared_ptr<const Surface> surface_;
};

/// Every point looked at, every time: the oracle that the fast searches are tested against.
class BruteForceCloud final : public Cloud {
 public:
  explicit BruteForceCloud(std::vector<Vec3> points, std::optional<Vec3> viewpoint = std::nullopt)
      : points_(std::move(points)), viewpoint_(viewpoint) {}

  void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept override;
  void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept override;

 private:
  std::vector<Vec3> points_;
  std::optional<Vec3> viewpoint_;
};

/// Several clouds that belong together, touched at once, each with its own pose and viewpoint.
class CloudSet final : public ObservedClouds {
 public:
  /// @throws Error if there are more than Patch::max_views clouds, or one is null.
  explicit CloudSet(std::vector<std::shared_ptr<const Cloud>> clouds);

 private:
  std::vector<std::shared_ptr<const Cloud>> clouds_;
};

}  // namespace palpate
