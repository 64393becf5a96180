// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "palpate/core/cloud.hpp"

namespace palpate {

/// Points with further properties; an empty member is not known. Library methods use points alone.
struct Surface {
  std::vector<Vec3> points{};                             ///< [m] world
  int columns = 0, rows = 0;                              ///< of points in the order of an image
  std::vector<Vec3> normals{};                            ///< [-] of each point, outward; or zero
  std::vector<std::array<std::uint32_t, 3>> triangles{};  ///< counter-clockwise from outside
};

/// Points in no particular order, sorted once into a hash of voxels on the camera's thread.
class PointCloud final : public Cloud {
 public:
  /// O(points). Non-finite points are left out and counted.
  /// @param points     [m] world
  /// @param viewpoint  [m] world: from where they were seen (PCD's VIEWPOINT), if known
  /// @param voxel      [m] edge; about the radius of a search is best. Widened if the cloud is so
  ///                   large that voxels could not be numbered.
  /// @throws Error if `voxel` is not in 0.001 to 1 m.
  explicit PointCloud(std::span<const Vec3> points, std::optional<Vec3> viewpoint = std::nullopt,
                      double voxel = 0.010);
  /// The same, keeping the further properties beside the points.
  /// @throws Error also if normals, image or triangles do not fit the points.
  explicit PointCloud(Surface surface, std::optional<Vec3> viewpoint = std::nullopt,
                      double voxel = 0.010);

  void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept override;
  void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept override;

  /// All points as given, non-finite ones included, with their further properties; or null.
  [[nodiscard]] const Surface* surface() const noexcept { return surface_.get(); }

  [[nodiscard]] std::size_t size() const noexcept { return x_.size(); }
  /// How many points were left out because a coordinate was not finite.
  [[nodiscard]] std::size_t non_finite() const noexcept { return non_finite_; }
  [[nodiscard]] Vec3 point(std::size_t i) const noexcept { return {x_[i], y_[i], z_[i]}; }
  /// [m] the edge of a voxel.
  [[nodiscard]] double voxel() const noexcept { return voxel_; }
  [[nodiscard]] const std::optional<Vec3>& viewpoint() const noexcept { return viewpoint_; }

 private:
  struct Cell {
    std::uint64_t key;
    std::uint32_t begin, end;  // points; empty slots have begin == end
  };
  using Index = std::array<std::int64_t, 3>;

  [[nodiscard]] const Cell* find(std::uint64_t key) const noexcept;
  template <class Visit>
  void for_each_cell(const Ball& ball, const Visit& visit) const noexcept;
  template <class Visit>
  void for_each_cell(const Vec3& low, const Vec3& high, const Visit& visit) const noexcept;
  template <class Visit>
  void for_each_cell(const Beam& beam, const SightCone& cone, const Visit& visit) const noexcept;

  std::vector<double> x_, y_, z_;  // sorted by voxel
  std::vector<Cell> cells_;        // open addressing, a power of two
  Vec3 corner_ = Vec3::Zero();     // smallest coordinates
  Vec3 extent_ = Vec3::Zero();
  double voxel_;
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

/// Several clouds touched at once, each with its own pose and viewpoint.
class CloudSet final : public Cloud {
 public:
  /// @throws Error if there are more than Patch::max_views clouds, or one is null.
  explicit CloudSet(std::vector<std::shared_ptr<const Cloud>> clouds);

  /// Each cloud may fill an equal share of the patch.
  void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept override;
  void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept override;
  void gather_sides(const Ball& ball, const Sides& sides, std::size_t max_points,
                    Patch& patch) const noexcept override;
  void gather_sheet(const Ball& ball, const Sheet& sheet, std::size_t max_points,
                    Patch& patch) const noexcept override;
  void gather_of(std::string_view material, const Ball& ball, std::size_t max_points,
                 Patch& patch) const noexcept override;
  /// That of the cloud that knows the smallest.
  [[nodiscard]] double spacing(const Vec3& place) const noexcept override;
  [[nodiscard]] bool has_materials() const noexcept override;
  [[nodiscard]] bool has_brightness() const noexcept override;
  /// All clouds that know something there. The brightness is that of the first.
  void sample(const Vec3& place, const Vec3& normal, double radius,
              SurfaceSample& sample) const noexcept override;

  [[nodiscard]] const std::vector<std::shared_ptr<const Cloud>>& clouds() const noexcept {
    return clouds_;
  }

 private:
  std::vector<std::shared_ptr<const Cloud>> clouds_;
};

}  // namespace palpate
