// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "palpate/servo/safety.hpp"
#include "palpate/viewer/protocol.hpp"

namespace palpate {

/// What a page may do; docs/protocol.md has the table.
enum class Role : std::uint8_t {
  looking,    ///< sees everything, changes nothing
  holding,    ///< has the hand: moves and resets it, sets method parameters, lowers limits
  operating,  ///< has the operator's token: everything
};
std::string_view to_string(Role role);

/// @throws Error naming the role that the command needs, if `role` is not enough.
void check_allowed(const Command& command, Role role);

/// In which direction a safety limit becomes stricter.
enum class Stricter : std::uint8_t {
  lower,
  higher,
  neither,  ///< it depends: the operator's alone
};
Stricter stricter_direction(std::string_view limit);

/// How far pages may set the limits of a session's safety chain.
///
/// The page that holds the hand may make a limit stricter than the operator has it, never looser:
/// the operator has what the session was started with until the operator's page sets another value.
/// The operator's page may loosen a limit up to what the session's options say, without which the
/// range of the table counts.
class LimitBounds {
 public:
  /// @param start     the limits at the session's start
  /// @param loosest   by name, the loosest value for the operator
  /// @throws Error for an unknown name, a value out of range, or a limit that has no strict end.
  explicit LimitBounds(const SafetyParameters& start,
                       const std::map<std::string, double>& loosest = {});

  /// @throws Error if the role may not set the limit to `value`; also for an unknown name.
  void check(std::string_view name, double value, Role role) const;
  /// The operator's page has set a limit: others are held to it from now on.
  void set_by_operator(std::string_view name, double value);

 private:
  SafetyParameters operators_;  // the operator's limits
  std::map<std::string, double> loosest_;
};

}  // namespace palpate
