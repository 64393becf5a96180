// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/servo/device.hpp"
#include "palpate/servo/workspace.hpp"

namespace palpate {

/// One point by the device and in the scene.
struct PointPair {
  Vec3 device;  ///< [m] position of the device's tip, device frame
  Vec3 world;   ///< [m] the same point in the scene
};

/// A placement that fits pairs of points best in the sense of least squares.
struct PlacementFit {
  Placement placement;            ///< world = world_from_device * (workspace_scale * device)
  std::vector<double> residuals;  ///< [m] world: distance of each pair after the fit
  double rms = 0.0;               ///< [m] root of the mean squared residual
};

/// How pairs are fitted.
struct FitOptions {
  /// Fit the scale too; otherwise `scale` is used as it is.
  bool fit_scale = false;
  double scale = 1.0;            ///< [-] scene metres per device metre
  double least_distance = 0.02;  ///< [m] world: no two points may be nearer to each other
  double least_height = 0.01;    ///< [m] world: of the triangle of points over its longest side
};

/// The rotation, translation and, if asked for, scale that take the device's points to the scene's
/// with the least sum of squared residuals (Kabsch 1976, Umeyama 1991).
/// @throws Error for fewer than three pairs; a number that is not finite; points that are too close
///         together or nearly on a line; distances that differ by more than a factor of 1.5 in the
///         two frames while the scale is not fitted (units); points that only a reflection fits
///         (swapped axes or a left-handed frame).
PlacementFit fit_placement(std::span<const PointPair> pairs, const FitOptions& options = {});

/// Reads a CSV file with a header that names at least dx,dy,dz,wx,wy,wz (metres, in any order) and
/// a line for each pair.
/// @throws Error naming FILE:LINE.
std::vector<PointPair> read_pairs(const std::filesystem::path& file);

/// Reads a CSV file of points: a header that names at least x,y,z (metres) and a line for each.
/// @throws Error naming FILE:LINE.
std::vector<Vec3> read_points(const std::filesystem::path& file);

/// Recognises the points that a person touches with a device: where a button goes down, or, on a
/// device without buttons, where the tip rests for half a second after it has moved by 1 cm.
class PointCapture {
 public:
  /// One reading of the device. @param t  [s] increasing
  /// @return the point [m, device], when one has just been taken
  std::optional<Vec3> add(const HandState& hand, double t) noexcept;

 private:
  std::optional<Vec3> reference_;  // the last point, or where the device was first
  bool travelled_ = false;
  std::optional<std::uint32_t> buttons_;  // of the reading before
  std::optional<double> rest_began_;      // [s]
  Vec3 rest_at_ = Vec3::Zero();           // where it began
  Vec3 sum_ = Vec3::Zero();               // of the positions since then
  double count_ = 0.0;
};

/// Reads `count` points from a device. Never enables it, and writes zero forces only.
///
/// A device whose hand is simulated is read on a clock of its own, as fast as possible; others at
/// 1 kHz, or from their own callback.
/// @param timeout   [s] for all of them
/// @param captured  called for each point, on the calling thread
/// @throws Error if the time is over, or the device reports a fault.
std::vector<Vec3> capture_points(Device& device, std::size_t count, double timeout,
                                 const std::function<void(const Vec3&)>& captured = {});

/// Where a second camera stands to a first one.
struct CameraFit {
  Eigen::Isometry3d first_from_second = Eigen::Isometry3d::Identity();  ///< optical frames
  /// Of a small turn [rad] about `centre` and a shift [m], axes of the first camera: what the
  /// noise of the depth leaves open. A wrong lens or scale of depth comes on top.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Vec3 centre = Vec3::Zero();  ///< [m, first camera] mean of what both see
  double rms = 0.0;            ///< [m] of the distances between the two surfaces
  double overlap = 0.0;        ///< [-] of the second image that fits what the first sees

  [[nodiscard]] double turn_deviation() const;   ///< [rad] the largest standard deviation
  [[nodiscard]] double shift_deviation() const;  ///< [m] likewise, at `centre`
};

/// Finds where the second camera stands from what both see of a scene at rest: the rigid motion
/// that takes its points onto the planes about those of the first (point-to-plane ICP, Chen and
/// Medioni 1992, with pairs by projection and Tukey's weights).
/// @param start  rough first_from_second, off by at most some 10 cm and 10 degrees
/// @throws Error if they see too little in common, if the surfaces do not fit, or if the geometry
///         leaves a shift or a turn open, such as those along and about a single plane.
CameraFit register_cameras(const DepthImage& first, const DepthImage& second,
                           const Eigen::Isometry3d& start);

}  // namespace palpate
