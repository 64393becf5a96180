// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "palpate/core/parameters.hpp"

namespace palpate::app {

/// The options that choose a method and its parameters, the same for every verb that renders.
/// Order of precedence: defaults, --config, --method and --set.
class MethodOptions {
 public:
  MethodOptions() = default;
  /// @param usual  the method where none is asked for
  explicit MethodOptions(Method usual) : usual_(usual) {}

  /// @param methods  what --method can be, for the help text; the usual one is added
  void add_to(CLI::App& command,
              const std::string& methods = "sight, paper, paper-as-printed or fixed-step");

  /// @throws Error for an unknown method, parameter or key, a value out of range, or a
  ///         configuration file that cannot be read.
  [[nodiscard]] Parameters parameters() const;
  /// The same where any method of the lab will do: its name, and the parameters for it.
  struct Any {
    std::string method;
    Parameters parameters;
  };
  /// @throws Error as parameters().
  [[nodiscard]] Any any_method() const;

 private:
  [[nodiscard]] Any read(void (*check)(const std::string& method)) const;

  Method usual_ = Method::sight;
  std::optional<std::string> method_;
  std::vector<std::string> assignments_;
  std::optional<std::string> config_;
};

/// The number that `text` is, whole. @throws Error naming `subject`.
double parse_number(const std::string& subject, const std::string& text);

}  // namespace palpate::app
