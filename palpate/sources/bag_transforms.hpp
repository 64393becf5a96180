// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/bag/bag_reader.hpp"
#include "palpate/sources/trajectory.hpp"

namespace palpate {

/// Where a camera was in a fixed frame, by the transforms (TF) that a bag has on /tf and
/// /tf_static.
///
/// Between two transforms it is interpolated: linear in translation, spherical (slerp) in rotation.
/// A frame of TF whose parent changes has the parent that it has last.
class BagTransforms {
 public:
  /// [s] Transforms farther apart are not interpolated.
  static constexpr double max_gap = 1.0;

  /// @param frame  of the camera's images or points, as their headers name it
  /// @param fixed  the fixed frame; empty: the first of map, odom and world that leads to `frame`
  /// @throws Error if `fixed` is named and does not lead there, or a transform is damaged.
  BagTransforms(BagReader& bag, const std::string& frame, const std::string& fixed);

  /// Does a bag have any?
  static bool are_in(const BagReader& bag);

  /// Empty where none leads to the camera.
  [[nodiscard]] const std::string& fixed_frame() const { return fixed_; }
  /// The frame above all others on the way from the camera's.
  [[nodiscard]] const std::string& root() const { return root_; }
  /// The camera's pose in the fixed frame; none at a time that the transforms do not cover.
  /// @param stamp  [s] since 1970
  /// @pre there is a fixed frame
  [[nodiscard]] std::optional<Eigen::Isometry3d> at(double stamp) const;

 private:
  std::string fixed_, root_;
  std::vector<Trajectory> moving_;  // with `still_`, in the order of `order_`
  std::vector<Eigen::Isometry3d> still_;
  std::vector<bool> order_;  // from the camera to the fixed frame: does this one move?
};

}  // namespace palpate
