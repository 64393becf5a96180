// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "palpate/methods/methods.hpp"
#include "palpate/record/session_reader.hpp"

namespace palpate {

/// What a replay found.
struct ReplayReport {
  std::uint64_t ticks = 0;            ///< replayed
  std::uint64_t frames = 0;           ///< adopted
  std::uint64_t different_ticks = 0;  ///< in which a bit differs
  /// The first of those: its number, and the field that differs.
  std::optional<std::uint64_t> first_difference;
  std::string field;
  double largest_difference = 0.0;  ///< [N] between two forces
  /// Why it could not go on to the end, such as ticks that the recorder lost; empty if it could.
  std::string broken_off;
  /// What the checksums say of all messages, also of those that a replay does not need.
  BagCheck check{};

  [[nodiscard]] bool identical() const {
    return different_ticks == 0 && broken_off.empty() && check.damage.empty();
  }
};

/// Runs the method anew on a session's frames, HIPs and settings, each before the tick that it
/// was used in, and compares each tick with the recorded one, bit for bit: the proxy, the normal,
/// the force before the safety chain, the state and the flags.
/// @param progress  called now and then with the number of ticks done; may be empty
/// @param methods   those that the session may name
/// A recording that is damaged in its midst, or names a method that is not there, ends the replay
/// there, as the report says.
ReplayReport replay(SessionReader& session, const std::function<void(std::size_t)>& progress = {},
                    const MethodRegistry& methods = standard_methods());

}  // namespace palpate
