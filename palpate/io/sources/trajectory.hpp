// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

namespace palpate {

/// The poses of a camera over time.
class Trajectory {
 public:
  /// [s] A pose is used for stamps up to this far from its own.
  static constexpr double tolerance = 0.02;
  /// [s] Poses farther apart are not interpolated: the camera's tracking was lost between them.
  static constexpr double max_gap = 0.2;

  struct Sample {
    double stamp;  ///< [s]
    Eigen::Vector3d translation;
    Eigen::Quaterniond rotation;

    [[nodiscard]] Eigen::Isometry3d pose() const {
      Eigen::Isometry3d pose(rotation);
      pose.translation() = translation;
      return pose;
    }
  };

  /// @param gap  [s] poses farther apart are not interpolated
  /// @pre the stamps increase
  explicit Trajectory(std::vector<Sample> samples, double gap = max_gap)
      : samples_(std::move(samples)), gap_(gap) {}

  /// The pose at `stamp`: linear in translation and spherical (slerp) in rotation between the poses
  /// before and after. None in a gap of the trajectory, or before or after it.
  [[nodiscard]] std::optional<Eigen::Isometry3d> at(double stamp) const;

 private:
  std::vector<Sample> samples_;
  double gap_;
};

/// Reads the TUM benchmark's format: lines of `stamp tx ty tz qx qy qz qw`, [s] and [m], the pose
/// of the optical frame in the world; lines that begin with # are comments.
/// @param name  of the file, for messages
/// @throws Error naming the line that is not of eight finite numbers, has a quaternion not
///         of length 1, or a stamp not after the one before.
Trajectory parse_trajectory(std::string_view text, const std::string& name);

/// Reads a JSON object with one array of rigid 4x4 matrices, one for each frame, row by row: either
/// `world_from_camera`, or `camera_from_...` with whatever the world is called, which is inverted.
/// @throws Error naming the matrix that is not of 4x4 numbers or not rigid.
std::vector<Eigen::Isometry3d> parse_pose_matrices(std::string_view json, const std::string& name);

/// An image and when it was taken.
struct StampedFile {
  double stamp;  ///< [s]
  std::string file;
};

/// Reads the TUM benchmark's list of images: lines of `stamp file`.
/// @throws Error naming the line that is not of that form, or has a stamp not after the one before.
std::vector<StampedFile> parse_image_list(std::string_view text, const std::string& name);

}  // namespace palpate
