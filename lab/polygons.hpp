// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Geometry>
#include <unsupported/Eigen/BVH>

#include "palpate/kernel/cloud/point_cloud.hpp"

namespace palpate::lab {

/// A surface of triangles near a place, with a tree of boxes over them: a mesh that came with the
/// cloud, or a depth image (or organised points) of which every four neighbours make two triangles.
class Polygons {
 public:
  /// @param reach  [m] pixels of an image farther than this from the place are left out
  explicit Polygons(double reach) : reach_(reach) {}

  /// Can triangles be made of such a cloud?
  /// @throws Error if it has points, but neither faces nor an image to make them of.
  static void check(const Cloud& cloud);
  /// Takes a new frame into use. The cloud must live until the next call. One that `check` refuses
  /// has no triangles.
  void frame(const Cloud& cloud) noexcept;
  /// Sees to it that all triangles within 2/3 of the reach of `place` are here.
  void cover(const Vec3& place);

  /// Where a ball that moves first meets a triangle from outside.
  struct Hit {
    double share;            ///< [-] of the way
    Vec3 normal;             ///< [-] from the place that it touches to its centre
    std::uint32_t triangle;  ///< which
  };
  /// @param radius  [m] 0: a point
  [[nodiscard]] std::optional<Hit> sweep(const Vec3& from, const Vec3& way, double radius) const;
  /// The place nearest to `at` on a triangle that `at` is in front of, if within a distance.
  [[nodiscard]] std::optional<Vec3> nearest(const Vec3& at, double within) const;

  /// [-] from `at` to where an image was seen from; none of a mesh.
  [[nodiscard]] std::optional<Vec3> towards_camera(const Vec3& at) const;
  /// [-] of a triangle, outward.
  [[nodiscard]] const Vec3& normal(std::uint32_t triangle) const { return normals_[triangle]; }
  /// [-] at a place on a triangle, interpolated between the normals of its corners: those that a
  /// mesh came with, or means of the triangles about them, weighted by area.
  [[nodiscard]] Vec3 shaded_normal(std::uint32_t triangle, const Vec3& at) const;
  [[nodiscard]] std::size_t size() const { return triangles_.size(); }

 private:
  using Corners = std::array<std::uint32_t, 3>;

  void add_grid(const std::vector<Vec3>& points, int columns, int rows,
                const std::optional<Vec3>& viewpoint);
  void add_mesh(const Surface& mesh);
  void add(const Cloud& cloud, const Vec3& place);
  template <class Visit>
  void for_each_in(const Eigen::AlignedBox3d& box, const Visit& visit) const;

  double reach_;
  const Cloud* cloud_ = nullptr;
  bool stale_ = true;
  Vec3 centre_ = Vec3::Zero();
  std::vector<Vec3> vertices_, vertex_normals_;
  std::vector<Corners> triangles_;
  std::vector<Vec3> normals_;  // of the triangles
  std::vector<Eigen::AlignedBox3d> boxes_;
  std::optional<Vec3> viewpoint_;  // [m] of the image that was added last
  Eigen::KdBVH<double, 3, std::uint32_t> tree_;
};

}  // namespace palpate::lab
