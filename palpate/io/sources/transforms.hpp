// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/bag/messages.hpp"
#include "palpate/io/sources/trajectory.hpp"

namespace palpate {

constexpr std::string_view transforms_topic = "/tf";                ///< those that change
constexpr std::string_view static_transforms_topic = "/tf_static";  ///< those that do not

/// A frame of TF as ROS 2 writes it; ROS 1 wrote them with a slash.
std::string plain_frame(const std::string& frame);

/// @param name  of its message, for errors  @throws Error if it is not rigid.
Trajectory::Sample sample_of(const ros::TransformStamped& transform, const std::string& name);

/// @param header  of the parent's frame
ros::TransformStamped transform_of(const ros::Header& header, const std::string& child,
                                   const Eigen::Isometry3d& parent_from_child);

/// The frames between a camera's and a fixed one.
struct TransformWay {
  std::vector<std::string> children;  ///< from the camera's upwards, each with a link of its own
  std::string fixed;                  ///< at the way's end; empty where none leads there
  std::string root;                   ///< above all others on the way from the camera's
};

/// Transforms over time, interpolated: linear in translation, spherical (slerp) in rotation. A
/// frame whose parent changes has the parent that it has last.
class Transforms {
 public:
  /// [s] Transforms farther apart are not interpolated.
  static constexpr double max_gap = 1.0;

  /// @param kept  [s] before the newest, for which they are kept
  explicit Transforms(double kept = std::numeric_limits<double>::infinity()) : kept_(kept) {}

  /// Notes which frame is whose child, but not where it is.
  /// @param moves  it came on /tf, not on /tf_static  @param name  of its message, for errors
  /// @throws Error if there are too many frames.
  void link(const ros::TransformStamped& transform, bool moves, const std::string& name);
  /// Notes where it is, too. @throws Error also if it is not rigid.
  void add(const ros::TransformStamped& transform, bool moves, const std::string& name);
  /// Is that the link by which its child hangs now?
  [[nodiscard]] bool holds(const ros::TransformStamped& transform, bool moves) const;

  /// @param fixed  the fixed frame; empty: the first of map, odom and world that leads to `frame`
  /// @param whose  TF, for errors
  /// @throws Error if `fixed` is named and does not lead there.
  [[nodiscard]] TransformWay way(const std::string& frame, const std::string& fixed,
                                 const std::string& whose) const;
  /// The pose of the way's first frame in its fixed one; none at a time that is not covered.
  /// @param stamp  [s] since 1970
  [[nodiscard]] std::optional<Eigen::Isometry3d> at(const TransformWay& way, double stamp) const;
  /// Is there a transform at `stamp` or later for all that moves on the way?
  [[nodiscard]] bool reach(const TransformWay& way, double stamp) const;

 private:
  struct Link {
    std::string parent;
    bool moves;
  };

  double kept_;
  std::map<std::string, Link> links_;                              // by the child's frame
  std::map<std::string, std::deque<Trajectory::Sample>> samples_;  // by the child; stamps increase
};

/// Where a camera was in a fixed frame, by the transforms (TF) of a bag.
class BagTransforms {
 public:
  /// @param frame  of the camera's images or points, as their headers name it
  /// @param fixed  the fixed frame; empty: the first of map, odom and world that leads to `frame`
  /// @throws Error if `fixed` is named and does not lead there, or a transform is damaged.
  BagTransforms(BagReader& bag, const std::string& frame, const std::string& fixed);

  /// Does a bag have any?
  static bool are_in(const BagReader& bag);

  /// Empty where none leads to the camera.
  [[nodiscard]] const std::string& fixed_frame() const { return way_.fixed; }
  /// The frame above all others on the way from the camera's.
  [[nodiscard]] const std::string& root() const { return way_.root; }
  /// The camera's pose in the fixed frame; none at a time that the transforms do not cover.
  /// @param stamp  [s] since 1970
  /// @pre there is a fixed frame
  [[nodiscard]] std::optional<Eigen::Isometry3d> at(double stamp) const {
    return transforms_.at(way_, stamp);
  }

 private:
  TransformWay way_;
  Transforms transforms_;  // of the way
};

}  // namespace palpate
