// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "lab/method.hpp"
#include "palpate/kernel/core/cloud.hpp"

#include "search/kd_tree.hpp"

namespace palpate::lab {

/// The points of the newest frame (or of the last few) near a place, with a k-d tree over them.
///
/// What a method needs per point it may then compute for these alone: for methods whose
/// publications work through the whole frame, this is the choice that favours them.
class LocalPoints {
 public:
  using Neighbour = KdTree::Neighbour;

  /// @param reach   [m] points farther than this from the place are left out
  /// @param window  how many frames count: the newest and those just before it
  explicit LocalPoints(double reach, std::size_t window = 1);

  /// Takes a new frame into use. The cloud must live until the next call.
  void frame(const Cloud& cloud);
  /// Sees to it that all points within 2/3 of the reach of `place` are here.
  /// @return  are the points others than before?
  bool cover(const Vec3& place);

  [[nodiscard]] const std::vector<Vec3>& points() const { return points_; }  ///< [m] world
  /// [-] of each point, where they came with normals (Surface) and one frame counts; or none. Zero
  /// where a point has none.
  [[nodiscard]] const std::vector<Vec3>& normals() const { return normals_; }
  /// [m] world: from where the newest frame was seen, if known.
  [[nodiscard]] const std::optional<Vec3>& viewpoint() const { return viewpoint_; }

  /// The points within a distance, in no order.
  void within(const Vec3& at, double radius, std::vector<Neighbour>& found) const;
  /// The nearest points, nearest first.
  void nearest(const Vec3& at, std::size_t count, std::vector<Neighbour>& found) const;

 private:
  double reach_;
  std::size_t window_;
  const Cloud* cloud_ = nullptr;
  Patch patch_;
  Vec3 centre_ = Vec3::Zero();
  bool stale_ = true;
  std::vector<Vec3> newest_;
  std::deque<std::vector<Vec3>> before_;
  std::vector<Vec3> points_, normals_;
  std::optional<Vec3> viewpoint_;
  std::unique_ptr<KdTree> tree_;
};

/// From where a surface at `at` was seen; from above where a cloud does not know.
inline Vec3 towards_viewer(const std::optional<Vec3>& viewpoint, const Vec3& at) {
  return viewpoint ? Vec3(*viewpoint - at) : Vec3(Vec3::UnitZ());
}

/// The moving-least-squares plane at the middle of a patch [7]: a = sum w x / sum w, and as normal
/// the eigenvector of the weighted covariance with the smallest eigenvalue, towards where the
/// points were seen from (else up). None for less than six points.
/// @param radius  [m] w is Wendland's function down to 0 there
std::optional<Contact> fit_plane(const Patch& patch, double radius);

/// The stiffest spring [N/m] with which a sampled wall stays passive [2]: a device with damping b
/// [N s/m] against a spring K and a damper B held for a period T [s] needs b > K T / 2 + B.
constexpr double passive_stiffness(double device_damping, double damping, double period) {
  return std::max(0.0, 2.0 * (device_damping - damping) / period);
}

}  // namespace palpate::lab
