// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>

#include <Eigen/Geometry>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// How a device's workspace lies in the scene.
struct Placement {
  Eigen::Isometry3d world_from_device = Eigen::Isometry3d::Identity();
  /// [-] scene metres per device metre. Forces are not scaled, so the hand feels the coupling's
  /// stiffness times this: scale up and the limit of stability comes nearer.
  double workspace_scale = 1.0;
  std::optional<int> clutch_button = {};  ///< none: only the device's own clutch
  /// [m, device] radius of the rate-control bubble around the workspace centre. Inside: position
  /// control. Outside: in addition a velocity of the HIP in the direction of the handle (rate
  /// control). 0: off.
  double bubble_radius = 0.0;
  /// [m/s, scene] largest velocity of rate control, from `bubble_rim` beyond the radius on.
  double bubble_speed = 0.1;
  /// [kg] handle mass that the motors compensate, in addition to the surface force and within the
  /// same limits (WeightSupport). 0: off.
  double handle_weight = 0.0;
  Vec3 down = -Vec3::UnitZ();  ///< [-] device: which way that weight pulls, of length 1

  static constexpr Key scale_key =
      key_of("scale", "--scale", "-", 1e-3, 1e3,
             "motion scale: scene metres per device metre; the felt stiffness grows with it");
  static constexpr Key radius_key =
      key_of("bubble_radius", "--bubble", "m", 0.0, 1.0,
             "radius around the centre of the device workspace outside which the HIP keeps moving "
             "in that direction (rate control), to reach points outside the workspace; 0: off");
  static constexpr Key speed_key =
      key_of("bubble_speed", "", "m/s", 1e-3, 1.0,
             "speed of the HIP in the scene under rate control, from 2 cm outside the radius on");
  static constexpr Key weight_key =
      key_of("handle_weight", "--handle-weight", "kg", 0.0, 0.1,
             "handle mass that the motors compensate, for a device without gravity compensation; "
             "`palpate doctor --device` measures it; 0: off");

  /// See Key.
  template <class Self, class Way>
  static void walk_keys(Self& self, const Way& way) {
    way(Key{"world_from_device", "",
            "pose of the device in the scene: x, y, z in m; quaternion x, y, z, w"},
        self.world_from_device);
    way(scale_key, self.workspace_scale);
    way(key_of("clutch_button", "--clutch-button", "-", 0.0, 31.0,
               "while this button of the device is pressed the HIP stays"),
        self.clutch_button);
    way(radius_key, self.bubble_radius);
    way(speed_key, self.bubble_speed);
    way(weight_key, self.handle_weight);
    for (int axis = 0; axis < 3; ++axis) {
      constexpr std::array<std::string_view, 3> names{"down_x", "down_y", "down_z"};
      way(key_of(names[static_cast<std::size_t>(axis)], "", "-", -1.0, 1.0,
                 "direction of gravity in the device frame"),
          self.down[axis]);
    }
  }

  bool operator==(const Placement& other) const {
    return world_from_device.matrix() == other.world_from_device.matrix() &&
           workspace_scale == other.workspace_scale && clutch_button == other.clutch_button &&
           bubble_radius == other.bubble_radius && bubble_speed == other.bubble_speed &&
           handle_weight == other.handle_weight && down == other.down;
  }
};

/// @throws Error if a number is out of its key's range, the pose not rigid and finite or `down` not
///         of length 1.
void validate(const Placement& placement);

using PlacementInfo = ParameterRow<Placement>;

/// Scale, origin, angles, bubble and handle of a placement, in the order in which the page shows
/// them. The angles turn about the world's x, then y, then z axis.
std::span<const PlacementInfo> placement_table();

/// Sets one of them by name; the others stay.
/// @throws Error for an unknown name (naming the nearest) or a value out of its range.
void set_placement(Placement& placement, std::string_view name, double value);

}  // namespace palpate
