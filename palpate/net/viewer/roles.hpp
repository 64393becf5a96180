// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>

#include "palpate/net/viewer/protocol.hpp"
#include "palpate/servo/safety.hpp"

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

/// The longest token [characters].
constexpr std::size_t longest_token = 128;

/// Is it the token? An empty one never is. Takes the same time for every `given`: neither its
/// length nor the place of the first difference shows. Of `given`, what is beyond `longest_token`
/// is not looked at; it is another then.
bool is_token(std::string_view given, std::string_view token);

/// Slows down who guesses tokens: after a few wrong ones, those of an address are not looked at for
/// a while that doubles with each further wrong one.
///
/// One wrong token again and again is a page left open from an earlier session, and counts once.
class GuessLimit {
 public:
  static constexpr std::size_t free_guesses = 8;      ///< wrong tokens before the first pause
  static constexpr double longest_pause = 300.0;      ///< [s]
  static constexpr double memory = 3600.0;            ///< [s] after which an address begins again
  static constexpr std::size_t max_addresses = 1024;  ///< remembered; then the oldest is forgotten

  /// [s] for which tokens from `address` are not looked at; 0: they are. @param t  [s] now
  [[nodiscard]] double pause(const std::string& address, double t) const;
  /// A token from `address` was wrong. @param t  [s] now
  void wrong(const std::string& address, std::string_view token, double t);

 private:
  struct Address {
    std::size_t guesses = 0;
    double last = 0.0;               // [s]
    double until = 0.0;              // [s] end of the pause
    std::deque<std::size_t> hashes;  // of the last wrong tokens
  };
  std::map<std::string, Address> addresses_;
};

}  // namespace palpate
