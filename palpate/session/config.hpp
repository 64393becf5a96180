// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
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

/// The page's server.
struct ServerConfig {
  std::string listen = "127.0.0.1";  ///< address
  std::optional<int> port = {};      ///< none: 8642, or any free one; 0: any free one
  std::string token = {};            ///< what a page must know; empty: none is asked for
  std::string operator_token = {};   ///< the operator's page's; empty: one is made
  bool browser = true;               ///< open one at the start, where there is a desktop

  /// See Key.
  template <class Self, class Way>
  static void walk_keys(Self& self, const Way& way) {
    way(Key{"listen", "--listen",
            "address on which the page is served (127.0.0.1: only for this computer). Tokens "
            "are sent unencrypted over the network: a tunnel from the other computer is safer, "
            "ssh -L 8642:localhost:8642 THIS_COMPUTER"},
        self.listen);
    way(key_of("port", "--port", "-", 0.0, 65535.0,
               "port of the page (8642, or any if that is in use); 0: any"),
        self.port);
    way(Key{"token", "--token",
            "access token for viewing and for controlling the HIP; empty: generated if other "
            "computers are allowed"},
        self.token);
    way(Key{"operator_token", "--operator-token",
            "access token of the operator: only a page with this token can change method, "
            "placement and limits, and record; empty: generated and printed. Other users of "
            "this computer can read the command line; use the environment variable instead"},
        self.operator_token);
    way(Key{"browser", "", "open a browser at the start, if there is a desktop"}, self.browser);
  }
};

/// A session of the program as one TOML file describes it. docs/session.md lists the keys.
struct SessionConfig : SessionSpec {
  SessionConfig() { cameras = {{.uri = "synthetic:desk?noise=1mm"}}; }

  std::string record_folder = {};  ///< folder of recordings started on the page; empty: the current
  double record_limit = 20.0;      ///< [GB] of all recordings of a session that pages start
  /// Per safety limit: the least strict value that the operator may set on the page; default: the
  /// end of its range.
  std::map<std::string, double> operator_limits = {};
  ServerConfig server;

  /// The keys outside tables; see Key.
  template <class Self, class Way>
  static void walk_keys(Self& self, const Way& way) {
    way(Key{"method", "", "how forces are computed"}, self.method);
    way(Key{"tool", "--tool",
            "what touches, such as box:40x20x5mm, capsule:80x8mm or mesh:FILE.stl?unit=mm; empty: "
            "a ball (docs/tools.md)"},
        self.tool);
    way(Key{"device", "", "URI of the haptic device; empty: the default"},
        self.hands.front().device);
    way(Key{"without_watchdog", "--without-watchdog",
            "allow forces above engage_force on a device that has motors but no watchdog of at "
            "most 0.5 s. Danger: if this program is killed, the device keeps the last force"},
        self.without_watchdog);
    way(key_of("rate", "--rate", "Hz", 100.0, 1e5, "ticks of the servo loop"), self.rate);
    way(Key{"fixtures", "--fixtures",
            "TOML file of virtual fixtures: forbidden regions, guides, viscous regions"},
        self.fixtures);
    way(Key{"record", "--record",
            "record the session into this folder as a ROS 2 bag; check it with palpate replay"},
        self.record);
    way(Key{"record_folder", "--record-folder",
            "folder for recordings started on the page; empty: the current folder"},
        self.record_folder);
    way(key_of("record_limit", "--record-limit", "GB", 1e-3, 1e6,
               "total size of the recordings started on the page; recording ends there, or when "
               "less than 1 GB is free"),
        self.record_limit);
  }
};

/// Throws Error if there is no method of that name; for what the file names.
using MethodCheck = std::function<void(const std::string& name)>;

/// Reads a session's TOML file. What it leaves out is taken from `base`.
/// @throws Error naming FILE:LINE for a file that cannot be read or is no TOML, an unknown key
///         (naming the nearest known one), a value of another type or out of range.
SessionConfig read_session_config(const std::filesystem::path& file, const SessionConfig& base = {},
                                  const MethodCheck& check_method = {});

/// The same from a text. @param name  of the file, for messages
SessionConfig parse_session_config(std::string_view text, const std::string& name,
                                   const SessionConfig& base = {},
                                   const MethodCheck& check_method = {});

/// The TOML file of a configuration, every key with its unit and range in a comment.
/// parse_session_config gives back the same values bit for bit, but for the rounding of the poses'
/// quaternions.
std::string to_toml(const SessionConfig& config);

/// A session's TOML text with another placement, and everything else, comments included, as it is.
/// @param text  may be empty
/// @param name  of the file, for messages
/// @throws Error as parse_session_config, or if the [placement] table is written in a way that
///         cannot be edited (an inline table).
std::string with_placement(std::string_view text, const std::string& name,
                           const Placement& placement);

/// @throws Error if a pose, the placement, a parameter or the rate is out of range.
void validate(const SessionConfig& config);

}  // namespace palpate
