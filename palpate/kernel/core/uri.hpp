// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// A source's or device's name taken apart: `SCHEME:PATH?KEY=VALUE&KEY=VALUE`.
///
/// The last '?' begins the options: a path that contains one is named with a '?' behind it.
/// Options without '=' have an empty value.
class Uri {
 public:
  /// @throws Error if there is no scheme, or an option has no name or is given twice.
  explicit Uri(std::string_view text);

  [[nodiscard]] const std::string& text() const { return text_; }
  [[nodiscard]] const std::string& scheme() const { return scheme_; }
  [[nodiscard]] const std::string& path() const { return path_; }

  [[nodiscard]] bool has(std::string_view key) const;
  /// The option's text, or `fallback` if it is not given.
  [[nodiscard]] std::string text_option(std::string_view key, std::string_view fallback) const;
  /// A number with an optional unit (`1mm`, `0.5cm`, `2m`, `30hz`, `33ms`, `5deg`, `2%`) in SI.
  /// @param si_unit  what it must measure: `m`, `s`, `Hz`, `rad`, `1` (a share) or `px`, which is
  ///                 written without a unit; empty for any
  /// @throws Error if it is not a finite number in [min, max], or has a unit that does not fit.
  [[nodiscard]] double number_option(std::string_view key, double fallback, double min, double max,
                                     std::string_view si_unit = {}) const;
  /// Returns a copy without option `key`, which the caller has already handled. allow_only() still
  /// lists it as a valid option.
  [[nodiscard]] Uri without(std::string_view key) const;
  /// @throws Error for any option that is not among `own`, naming the nearest.
  void allow_only(std::span<const std::string_view> own) const;

 private:
  std::string text_, scheme_, path_;
  std::map<std::string, std::string, std::less<>> options_;
  std::vector<std::string> taken_;  // options that somebody else takes
};

}  // namespace palpate
