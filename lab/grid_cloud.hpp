// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <utility>

#include "lab/experiment.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/mathematics.hpp"

namespace palpate::lab {

/// The synthetic point clouds of section 5: points on a square grid over a height field, with fresh
/// zero-mean Gaussian noise in every frame, seen from far above.
struct GridCloud {
  std::function<double(double x, double y)> height = [](double, double) { return 0.0; };  ///< [m]
  double spacing = 1.5e-3;     ///< [m] 0.3 r_c, Table 2
  double half_x = 0.06;        ///< [m] extent to each side of the origin; points farther than this
  double half_y = 0.06;        ///<     from the proxy can't touch it and are left out
  double sigma = 0.0;          ///< [m] standard deviation of each coordinate (white), or of the
                               ///<     height (correlated)
  Noise noise = Noise::white;  ///< correlated: over 5 points, exp(-(d / 5 spacings)^2)
  std::uint64_t seed = 1;

  /// Frame number `frame`; the number picks the noise. Rows and columns are told, and the normals
  /// of the surface without noise.
  /// @param lift  [m] added to the height
  [[nodiscard]] std::unique_ptr<PointCloud> capture(std::uint64_t frame, double lift) const;
};

/// A grid of Table 2's spacing that is level, unless a height is set. @param half  [m] its extent
inline GridCloud level_grid(double r_c, double half) {
  GridCloud grid;
  grid.spacing = 0.3 * r_c;
  grid.half_x = grid.half_y = half;
  return grid;
}

/// A grid at rest under a hand. @param grid  must outlive it  @param hip  [m] at a time [s]
inline Scenario over_grid(const GridCloud& grid, double duration,
                          std::function<Vec3(double t)> hip) {
  return {.duration = duration,
          .cloud = [&grid](std::uint64_t frame, double) { return grid.capture(frame, 0.0); },
          .hip = std::move(hip)};
}

/// A plane without noise that goes up and down by 20 mm once a second, for 4 s at 30 Hz, under a
/// hand that rests 5 mm below its lowest. The force is limited to 100 N.
/// @param on_tick  (const Tick&, double height [m] of the plane, double ideal [N]), from 1 s on
template <class OnTick>
void push_by_sine(const std::string& name, const ExperimentOptions& options,
                  const OnTick& on_tick) {
  constexpr double stroke = 0.020;  // [m]
  const double r_c = options.parameters.proxy.r_c();
  const auto height = [](double t) {
    return 0.5 * stroke * (1.0 - math::cos(2.0 * std::numbers::pi * t));
  };
  Parameters parameters = options.parameters;
  parameters.coupling.max_force = 100.0;
  const GridCloud grid = level_grid(r_c, 12.0 * r_c);
  const auto method = make_method(name, {parameters, flat_truth(height)}, options.own_methods);
  const Vec3 hip(0.1 * r_c, 0.1 * r_c, -0.005);
  method->seat(Vec3(hip.x(), hip.y(), 4.0 * r_c));
  play(*method,
       {.duration = 4.0,
        .cloud = [&](std::uint64_t f, double t) { return grid.capture(f, height(t)); },
        .hip = [&](double) { return hip; }},
       [&](const Tick& tick) {
         const double z = height(tick.t);
         if (tick.t >= 1.0) on_tick(tick, z, parameters.coupling.stiffness * (z - hip.z()));
         return true;
       });
}

}  // namespace palpate::lab
