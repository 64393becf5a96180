// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

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

}  // namespace palpate
