// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "lab/experiment.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"

namespace palpate::lab {

/// The synthetic point clouds of section 5: points on a square grid over a height field, with fresh
/// zero-mean Gaussian noise in every frame, seen from far above.
struct GridCloud {
  std::function<double(double x, double y)> height = [](double, double) { return 0.0; };  ///< [m]
  double spacing = 1.5e-3;     ///< [m] 0.3 r_c, Table 2
  double half_x = 0.06;        ///< [m] extent to each side of `centre_x`; points farther than this
  double half_y = 0.06;        ///<     from the proxy can't touch it and are left out
  double centre_x = 0.0;       ///< [m]
  double centre_y = 0.0;       ///< [m]
  double sigma = 0.0;          ///< [m] standard deviation of each coordinate (white), or of the
                               ///<     height (correlated)
  Noise noise = Noise::white;  ///< correlated: over 5 points, exp(-(d / 5 spacings)^2)
  std::uint64_t seed = 1;

  /// Frame number `frame`; the number picks the noise. Rows and columns are told, and the normals
  /// of the surface without noise.
  /// @param lift  [m] added to the height
  [[nodiscard]] std::unique_ptr<PointCloud> capture(std::uint64_t frame, double lift) const;
};

}  // namespace palpate::lab
