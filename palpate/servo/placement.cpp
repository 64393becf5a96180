// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/placement.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "palpate/kernel/core/error.hpp"

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

// The row of a number that is a key.
template <double Placement::*member>
PlacementInfo row_of_key(const Key& key, std::string_view source = "") {
  return palpate::row_of<member>(key.name, "", key.unit, key.min, key.max, key.meaning, source);
}

}  // namespace

void validate(const Placement& placement) {
  check_keys(placement);
  constexpr double rounding = 1e-3;
  if (!(std::abs(placement.down.norm() - 1.0) <= rounding))
    throw Error("down", "its length is " + number_text(placement.down.norm()),
                "give a direction of length 1 in the device's axes, such as 0, 0, -1");
}

std::span<const PlacementInfo> placement_table() {
  using P = Placement;
  constexpr std::string_view where = "device's origin in the world";
  static const std::array rows{
      row_of_key<&P::workspace_scale>(P::scale_key),
      PlacementInfo{"origin_x", "", "m", 0.0, -farthest, farthest, where, "", origin<0>,
                    set_origin<0>},
      PlacementInfo{"origin_y", "", "m", 0.0, -farthest, farthest, where, "", origin<1>,
                    set_origin<1>},
      PlacementInfo{"origin_z", "", "m", 0.0, -farthest, farthest, where, "", origin<2>,
                    set_origin<2>},
      PlacementInfo{"roll", "", "rad", 0.0, -pi, pi, "device's rotation about the world's x axis",
                    "", angle<0>, set_angle<0>},
      PlacementInfo{"pitch", "", "rad", 0.0, -0.5 * pi, 0.5 * pi, "then about the world's y axis",
                    "", angle<1>, set_angle<1>},
      PlacementInfo{"yaw", "", "rad", 0.0, -pi, pi, "then about the world's z axis", "", angle<2>,
                    set_angle<2>},
      row_of_key<&P::bubble_radius>(P::radius_key, "Dominjon et al. 2005"),
      row_of_key<&P::bubble_speed>(P::speed_key),
      row_of_key<&P::handle_weight>(P::weight_key),
  };
  return rows;
}

void set_placement(Placement& placement, std::string_view name, double value) {
  set_by_name(placement_table(), placement, name, value, "placement");
}

}  // namespace palpate
