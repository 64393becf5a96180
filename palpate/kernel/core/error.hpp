// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

namespace palpate {

/// Error in opening, parsing or configuring something; never thrown inside a tick.
///
/// `what()` reads `WHAT: WHY; REMEDY` on one line: the file or argument, what was wrong with it,
/// and what to do. Programs print it after their name. Parts may quote a damaged file: terminal
/// control characters become spaces.
class Error : public std::runtime_error {
 public:
  /// @param subject  the file, option or argument concerned
  /// @param reason   what was wrong with it
  /// @param remedy   what the user can do; may be empty
  Error(const std::string& subject, const std::string& reason, const std::string& remedy = {})
      : std::runtime_error(
            one_line(subject + ": " + reason + (remedy.empty() ? "" : "; " + remedy))) {}

 private:
  static std::string one_line(std::string text) {
    for (char& c : text) {
      if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = ' ';
    }
    return text;
  }
};

}  // namespace palpate
