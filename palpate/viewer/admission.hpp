// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <string>
#include <string_view>

namespace palpate {

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
