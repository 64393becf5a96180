// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/servo/placement.hpp"
#include "palpate/servo/safety.hpp"

namespace palpate {

/// A camera of a session.
struct CameraSpec {
  std::string uri = {};
  /// Pose of the optical frame; none: the source's own.
  std::optional<Eigen::Isometry3d> world_from_camera = {};
  std::string name = {};  ///< for messages and the page; empty: the URI

  /// See Key.
  template <class Self, class Way>
  static void walk_keys(Self& self, const Way& way) {
    way(Key{"uri", "", "source of the frames"}, self.uri);
    way(Key{"name", "", "name in messages; empty: the URI"}, self.name);
    way(Key{"world_from_camera", "", "pose of the optical frame; default: the source's own"},
        self.world_from_camera);
  }
};

/// A hand of a session: a haptic device, and where it lies in the scene.
struct HandSpec {
  std::string device = {};  ///< URI; empty: `hand:`, or the program's choice
  /// For messages, topics and the page: small letters, digits and _, beginning with a letter.
  /// Empty: hand_1, hand_2, ..., or no name if it is the only hand.
  std::string name = {};
  Placement placement = {};

  /// See Key.
  template <class Self, class Way>
  static void walk_keys(Self& self, const Way& way) {
    way(Key{"device", "", "URI of a further haptic device"}, self.device);
    way(Key{"name", "", "name in messages, topics and on the page; empty: hand_2, hand_3, ..."},
        self.name);
    Placement::walk_keys(self.placement, way);
  }
};

/// A session as files, command lines, Python and C++ describe it.
struct SessionSpec {
  std::vector<CameraSpec> cameras = {};  ///< 1 to Patch::max_views
  /// 1 to Session::most_hands. They share cameras, method, parameters, limits and fixtures, and
  /// have a device, a loop, a method's memory and a safety chain each. While one of them has a
  /// fault (is_in_trouble), none of them has a force.
  std::vector<HandSpec> hands = {HandSpec()};
  std::string method = "sight";
  /// What the method touches with, as make_tool reads it; `ball`, or empty: a ball.
  std::string tool = {};
  /// Those with value 0 that depend on the sensor type are replaced by for_sensors().
  Parameters parameters = {};
  /// Somebody chose the proxy's radii. If not, they are as for_points has them for what the cameras
  /// see first.
  bool radii_chosen = false;
  SafetyParameters safety = {};
  std::string fixtures = {};  ///< TOML file of virtual fixtures; empty: none
  double rate = 1000.0;       ///< [Hz] of the servo loop
  /// Real time: allows a device with motors to send more than SafetyParameters::engage_force
  /// although it states no watchdog (DeviceInfo::watchdog) of at most 0.5 s: if this process is
  /// killed, its last force stays. `open_guarded` gives a device a watchdog.
  bool without_watchdog = false;
  std::string record = {};  ///< folder to record into from the start; empty: none
};

}  // namespace palpate
