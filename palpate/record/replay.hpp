// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "palpate/kernel/methods/methods.hpp"
#include "palpate/record/session_reader.hpp"

namespace palpate {

/// Where a replay came to another number than the recording.
struct ReplayDifference {
  std::uint64_t tick = 0;  ///< its number
  std::string field;       ///< as in tick_columns()
  double recorded = 0.0, replayed = 0.0;
};

/// Ticks of which some fields differ in a bit.
struct ReplayDifferences {
  std::uint64_t ticks = 0;
  std::optional<ReplayDifference> first{};
  double largest_force = 0.0;  ///< [N] between recorded and replayed force
};

/// What a replay found.
struct ReplayReport {
  std::uint64_t ticks = 0;          ///< replayed
  std::uint64_t frames = 0;         ///< adopted
  std::uint64_t hash = empty_hash;  ///< of the ticks as they are now
  /// What the method made: HIP, proxy, normal, the wrench that it asked for, state, steps, the
  /// surface's velocity and motion, flags.
  ReplayDifferences asked{};
  /// What the cycle made of it: the wrench that was sent, gain, safety flags, the frame's age and
  /// stamp, flags of the hand, energy, the forces of fixtures.
  ReplayDifferences sent{};
  /// Why it could not continue to the end, such as ticks that the recorder lost; empty if it could.
  std::string broken_off;
  /// What the checksums say of all messages, also of those that a replay does not need.
  BagCheck check{};

  /// Is everything that could be compared the same?
  [[nodiscard]] bool identical() const {
    return asked.ticks == 0 && sent.ticks == 0 && broken_off.empty() && check.damage.empty();
  }
};

/// What the checksums of a recording say, in a line without its end.
std::string text_of(const BagCheck& check);
/// The same of a replay, in lines.
std::string text_of(const ReplayReport& report);

/// Runs the loop's cycle again, method and safety chain, on what went into it: a session's frames,
/// hands, settings and wake-up times. Compares each tick with the recorded one, bit for bit.
///
/// Columns that a recording of another version lacks are not compared. Where it is damaged or names
/// a method that is not there, the replay ends, as the report says.
/// @param progress  called now and then with the number of ticks done; may be empty
/// @param methods   those that the session may name
ReplayReport replay(SessionReader& session, const std::function<void(std::size_t)>& progress = {},
                    const MethodRegistry& methods = standard_methods());

}  // namespace palpate
