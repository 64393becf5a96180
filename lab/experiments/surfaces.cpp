// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/grid_cloud.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"
#include "lab/statistics.hpp"
#include "palpate/io/sources/scene.hpp"

namespace palpate::lab {
namespace {

// 5.1: along x at 2 r_c/s, above the plane, from 1 s on below it, from 4 s on above it again. How
// far is not printed: 2 r_c.
std::string flat_rows(const std::string& name, const ExperimentOptions& options) {
  const double r_c = options.parameters.proxy.r_c();
  const GridCloud grid = level_grid(r_c, 15.0 * r_c);  // 100 x 100 points
  const auto method = make_method(name, {options.parameters, flat_truth()});
  std::string rows;
  play(*method,
       over_grid(grid, 5.0,
                 [&](double t) {
                   const bool below = t >= 1.0 - 1e-9 && t < 4.0 - 1e-9;
                   // A little askew, or it would see one line of the grid only.
                   const double x = (2.0 * t - 5.0) * r_c;
                   return Vec3(x, 0.1 * x, below ? -2.0 * r_c : 2.0 * r_c);
                 }),
       [&](const Tick& tick) {
         rows += csv_row(name, tick.t, tick.hip.x(), tick.hip.z(), tick.proxy.x(), tick.proxy.z(),
                         tick.proxy.z() - r_c, tick.force.norm(), tick.steps);
         return true;
       });
  return rows;
}

std::vector<Claim> flat_claims(const Table& table) {
  const std::vector<double> contact = table.numbers("contact_y", [&](std::size_t row) {
    const double t = table.number(row, "t");
    return table.text(row, "method") == "paper" && t > 1.2 && t < 3.9;
  });
  if (contact.empty()) return {};
  const auto [low, high] = std::minmax_element(contact.begin(), contact.end());
  const double amplitude = 0.5 * (*high - *low) / 5e-3;
  return {{"5.1, Fig. 11", "the amplitude of this periodic pattern is 0.01 r_c", "0.01 r_c",
           fmt::format("{:.4f} r_c", amplitude),
           amplitude > 0.005 && amplitude < 0.02
               ? "reproduced (geometry: between four points r_c - sqrt(r_c^2 - s^2/2) = 0.023 r_c "
                 "peak to peak)"
               : "differs"}};
}

// 5.3: a 300 x 100 grid shaped as a triangle wave with growing amplitude.
std::string corners_rows(const std::string& name, const ExperimentOptions& options) {
  const double r_c = options.parameters.proxy.r_c();
  const auto scene = std::make_shared<const Scene>(make_scene(Uri("synthetic:triangle-wave")));
  const auto height = [&](double x, double y) {
    const auto hit = scene->cast(Vec3(x, y, 1.0), -Vec3::UnitZ(), 0.0);
    return hit ? 1.0 - *hit : 0.0;
  };
  GridCloud grid = level_grid(r_c, 45.0 * r_c);
  grid.height = height;
  grid.half_y = 15.0 * r_c;
  const auto method = make_method(name, {options.parameters, truth_of(scene)});
  const double from = -38.0 * r_c;
  const double to = 38.0 * r_c;
  const double speed = 10.0 * r_c;  // [m/s]
  const std::unique_ptr<Cloud> cloud = grid.capture(0, 0.0);
  method->seat(Vec3(from, 0.1 * r_c, height(from, 0.0) + 3.0 * r_c));
  method->observe({*cloud, 0.0});
  std::string rows;
  const auto ticks = static_cast<int>((to - from) / speed * 1000.0);
  for (int i = 0; i <= ticks; ++i) {
    const double t = i * 1e-3;
    // The hand stays 2 r_c below the mean height of the wave.
    const Tick tick = method->tick(Vec3(from + speed * t, 0.1 * r_c, -2.0 * r_c), t);
    // The contact point: on the sphere, towards the surface.
    const SurfacePoint under = scene->nearest(tick.proxy, 0.0);
    const Vec3 contact = tick.proxy - r_c * under.normal;
    if (i % 5 == 0 && i > 50)
      rows += csv_row(name, tick.hip.x(), tick.proxy.x(), tick.proxy.z(), contact.x(), contact.z(),
                      height(contact.x(), 0.0), under.distance - r_c);
  }
  return rows;
}

std::vector<Claim> corners_claims(const Table& table) {
  std::vector<double> gap = table.numbers("gap", {{"method", "paper"}});
  if (gap.empty()) return {};
  const double mean = rms(gap);
  for (double& each : gap) each = std::abs(each);
  return {{"5.3, Fig. 14",
           "the convex part is rendered very well as a sharp edge; concave parts as "
           "far as the proxy fits",
           "a figure",
           fmt::format("gap between sphere and true surface {:.3f} mm rms, {:.2f} mm at most",
                       1e3 * mean, 1e3 * largest(gap)),
           mean < 0.3e-3 ? "reproduced (tolerance 0.3 mm rms: a fifth of the point spacing)"
                         : "differs"}};
}

}  // namespace

Experiment flat_experiment() {
  return {.name = "flat",
          .summary = "5.1, Fig. 11: along a flat grid, above and below it",
          .header = "method,t,hip_x,hip_y,proxy_x,proxy_y,contact_y,force_n,steps",
          .default_methods = {"paper", "ideal"},
          .cells = by_method<flat_rows>,
          .claims = flat_claims};
}

Experiment corners_experiment() {
  return {.name = "corners",
          .summary = "5.3, Fig. 14: a triangle wave with growing amplitude",
          .header = "method,hip_x,proxy_x,proxy_z,contact_x,contact_z,true_z,gap",
          .default_methods = {"paper", "ideal"},
          .cells = by_method<corners_rows>,
          .claims = corners_claims};
}

}  // namespace palpate::lab
