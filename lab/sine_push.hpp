// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>

#include "lab/experiment.hpp"
#include "lab/grid_cloud.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"

namespace palpate::lab {

/// A plane without noise that goes up and down by 20 mm once a second, for 4 s at 30 Hz, under a
/// hand that rests 5 mm below its lowest. The force is limited to 100 N.
/// @param on_tick  (const Tick&, double height [m] of the plane, double ideal [N]), from 1 s on
template <class OnTick>
void push_by_sine(const std::string& name, const ExperimentOptions& options,
                  const OnTick& on_tick) {
  constexpr double stroke = 0.020;  // [m]
  const double r_c = options.parameters.proxy.r_c();
  const auto height = [](double t) {
    return 0.5 * stroke * (1.0 - std::cos(2.0 * std::numbers::pi * t));
  };
  Parameters parameters = options.parameters;
  parameters.coupling.max_force = 100.0;
  GridCloud grid;
  grid.spacing = 0.3 * r_c;
  grid.half_x = grid.half_y = 12.0 * r_c;
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
