// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/servo/cycle.hpp"

namespace palpate {

/// What a recording says of its session as a whole.
struct SessionInfo {
  /// Who called the renderer: in a live loop a tick adopts the newest frame alone; a run as fast as
  /// the machine can adopts each, in order.
  enum class Kind { live, headless };

  Kind kind = Kind::headless;
  std::string version{};               ///< of palpate
  std::vector<std::string> cameras{};  ///< URIs
  std::string device{};                ///< URI
  std::int64_t epoch = 0;              ///< [ns] since 1970: when the session's clock was 0
  std::optional<Vec3> seat{};          ///< [m] where the proxy was put before the first tick
  /// Of the device; none in recordings of which a replay cannot run the safety chain.
  std::optional<DeviceLimits> limits{};
  /// The hand's name, in a session of several; the recording of the first one names the others,
  /// which lie in its hand_folder().
  std::string hand{};
  std::vector<std::string> more_hands{};
  bool frames_in_parent = false;  ///< of a hand after the first: its frames are in the first one's
};

/// Where the recording of a hand after the first lies within that of the first.
std::filesystem::path hand_folder(const std::filesystem::path& first, const std::string& hand);

/// The topics of a session besides its cameras' (CameraTopics).
namespace session_topic {
constexpr std::string_view session = "/palpate/session";    ///< String, JSON: SessionInfo
constexpr std::string_view settings = "/palpate/settings";  ///< String, JSON: each ServoCommands
constexpr std::string_view frame = "/palpate/frame";        ///< Float64MultiArray: each frame put
constexpr std::string_view adopted = "/palpate/adopted";    ///< Float64MultiArray: AdoptedFrame
constexpr std::string_view state = "/palpate/state";        ///< Float64MultiArray: CycleState
constexpr std::string_view tick = "/palpate/tick";          ///< Float64MultiArray: each ServoTick
constexpr std::string_view hip = "/palpate/hip";            ///< PoseStamped, of each tick
constexpr std::string_view proxy = "/palpate/proxy";        ///< PoseStamped
constexpr std::string_view force = "/palpate/force";        ///< WrenchStamped: what the hand felt
constexpr std::string_view transforms = "/tf";              ///< the cameras' places
}  // namespace session_topic

constexpr std::string_view world_frame = "world";

/// The numbers of /palpate/tick, in their order: a ServoTick to the bit. Those of energy_columns()
/// and of fixture_columns() follow; recordings that are older lack them.
const std::vector<std::string>& tick_columns();
const std::vector<std::string>& energy_columns();
const std::vector<std::string>& fixture_columns();
std::vector<double> row_of(const ServoTick& tick);          ///< those of tick_columns()
std::vector<double> energy_row_of(const ServoTick& tick);   ///< those of energy_columns()
std::vector<double> fixture_row_of(const ServoTick& tick);  ///< those of fixture_columns()
std::vector<double> whole_row_of(const ServoTick& tick);    ///< all, as they are written
/// What has no columns is zero.
/// @throws Error naming `name` if the numbers are not as many as tick_columns(), or those and
///         energy_columns(), or those and fixture_columns().
ServoTick tick_of(std::span<const double> row, const std::string& name);

/// number, stamp, put_at, for each camera its number and when its frame was captured, and the tick.
std::vector<double> row_of(const AdoptedFrame& frame);
/// @throws Error naming `name` if it is damaged.
AdoptedFrame adopted_of(std::span<const double> row, const std::string& name);

std::string to_json(const SessionInfo& info);
/// @throws Error naming `name` if it is damaged.
SessionInfo session_from_json(const std::string& text, const std::string& name);

std::string to_json(const ServoCommands& commands);
/// @throws Error naming `name` if it is damaged or does not validate.
ServoCommands commands_from_json(const std::string& text, const std::string& name);

}  // namespace palpate
