// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/placement_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace palpate {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double farthest = 10.0;  // [m] of an origin that a slider can set

// Angles [rad] about x, y and z, applied in this order: R = R_z R_y R_x.
Vec3 angles_of(const Placement& placement) {
  const Eigen::Matrix3d r = placement.world_from_device.linear();
  const double pitch = std::asin(std::clamp(-r(2, 0), -1.0, 1.0));
  if (std::abs(r(2, 0)) > 1.0 - 1e-12) return {std::atan2(-r(1, 2), r(1, 1)), pitch, 0.0};
  return {std::atan2(r(2, 1), r(2, 2)), pitch, std::atan2(r(1, 0), r(0, 0))};
}

template <int axis>
double origin(const Placement& placement) {
  return placement.world_from_device.translation()[axis];
}

template <int axis>
void set_origin(Placement& placement, double value) {
  placement.world_from_device.translation()[axis] = value;
}

template <int axis>
double angle(const Placement& placement) {
  return angles_of(placement)[axis];
}

template <int axis>
void set_angle(Placement& placement, double value) {
  Vec3 angles = angles_of(placement);
  angles[axis] = value;
  placement.world_from_device.linear() =
      (Eigen::AngleAxisd(angles.z(), Vec3::UnitZ()) * Eigen::AngleAxisd(angles.y(), Vec3::UnitY()) *
       Eigen::AngleAxisd(angles.x(), Vec3::UnitX()))
          .toRotationMatrix();
}

constexpr std::array placement_rows{
    PlacementInfo{"scale", "", "-", 1.0, 0.001, 1000.0,
                  "scene metres per device metre; the felt stiffness grows with it", "",
                  [](const Placement& p) { return p.workspace_scale; },
                  [](Placement& p, double v) { p.workspace_scale = v; }},
    PlacementInfo{"origin_x", "", "m", 0.0, -farthest, farthest, "device's origin in the world", "",
                  origin<0>, set_origin<0>},
    PlacementInfo{"origin_y", "", "m", 0.0, -farthest, farthest, "device's origin in the world", "",
                  origin<1>, set_origin<1>},
    PlacementInfo{"origin_z", "", "m", 0.0, -farthest, farthest, "device's origin in the world", "",
                  origin<2>, set_origin<2>},
    PlacementInfo{"roll", "", "rad", 0.0, -pi, pi, "device's rotation about the world's x axis", "",
                  angle<0>, set_angle<0>},
    PlacementInfo{"pitch", "", "rad", 0.0, -0.5 * pi, 0.5 * pi, "then about the world's y axis", "",
                  angle<1>, set_angle<1>},
    PlacementInfo{"yaw", "", "rad", 0.0, -pi, pi, "then about the world's z axis", "", angle<2>,
                  set_angle<2>},
    PlacementInfo{"bubble_radius", "", "m", 0.0, 0.0, 1.0,
                  "radius around the centre of the device workspace outside which rate control "
                  "moves the HIP on; 0: off",
                  "Dominjon et al. 2005", [](const Placement& p) { return p.bubble_radius; },
                  [](Placement& p, double v) { p.bubble_radius = v; }},
    PlacementInfo{"bubble_speed", "", "m/s", 0.1, 0.001, 1.0,
                  "speed of the HIP in the scene, from 2 cm outside this radius on", "",
                  [](const Placement& p) { return p.bubble_speed; },
                  [](Placement& p, double v) { p.bubble_speed = v; }},
    PlacementInfo{"handle_weight", "", "kg", 0.0, 0.0, 0.1,
                  "handle mass that the motors compensate; 0: off", "",
                  [](const Placement& p) { return p.handle_weight; },
                  [](Placement& p, double v) { p.handle_weight = v; }},
};

}  // namespace

std::span<const PlacementInfo> placement_table() {
  return placement_rows;
}

void set_placement(Placement& placement, std::string_view name, double value) {
  set_by_name(placement_table(), placement, name, value, "placement");
}

}  // namespace palpate
