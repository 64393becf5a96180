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
  std::string version{};               ///< of palpate
  std::vector<std::string> cameras{};  ///< URIs
  std::string device{};                ///< URI
  std::int64_t epoch = 0;              ///< [ns] since 1970: when the session's clock was 0
  DeviceLimits limits{};               ///< of the device
  /// The hand's name, in a session of several; the recording of the first one names the others,
  /// which lie in its hand_folder().
  std::string hand{};
  std::vector<std::string> more_hands{};
  bool frames_in_parent = false;  ///< of a hand after the first: its frames are in the first one's
  std::vector<std::string> tick_columns{};  ///< read: of its ticks; written: those of palpate now
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

/// The names of the numbers of /palpate/tick as they are written, in their order: a ServoTick to
/// the bit.
const std::vector<std::string>& tick_columns();
std::vector<double> row_of(const ServoTick& tick);

/// A hash of ticks before the first one is added.
inline constexpr std::uint64_t empty_hash = 0xcbf29ce484222325U;
/// Adds the bits of a tick's numbers, from its time to the flags of the hand, by FNV-1a: equal
/// inputs and settings give equal hashes on every machine.
void add_to_hash(std::uint64_t& hash, const ServoTick& tick);

/// Reads the ticks of a recording, whose columns may be those of another version.
class TickRows {
 public:
  /// @param columns  the names of its numbers; those that this version does not know are left out
  explicit TickRows(std::span<const std::string> columns = tick_columns());

  /// What has no column is as in a ServoTick that nothing was written to.
  /// @throws Error naming `name` if the row has another length, or a number that cannot be.
  [[nodiscard]] ServoTick read(std::span<const double> row, const std::string& name) const;
  /// Is there a column for number i of tick_columns()?
  [[nodiscard]] bool has(std::size_t i) const { return places_[i].has_value(); }

 private:
  std::size_t width_;
  std::vector<std::optional<std::size_t>> places_;  // in a row, of each of tick_columns()
};

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
