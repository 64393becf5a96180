// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "palpate/kernel/core/method.hpp"
#include "palpate/session/config.hpp"

namespace palpate::app {

/// A method by its name, and the parameters for it.
struct MethodChoice {
  std::string name;
  Parameters parameters;
};

/// The options that choose a method and its parameters, the same for every verb that renders.
/// Order of precedence: defaults, --config, --method and --set.
class MethodOptions {
 public:
  /// Adds --method, --set and --config.
  void add_to(CLI::App& command);
  /// The same without --method.
  void add_parameters_to(CLI::App& command);

  /// @throws UnknownMethod for a method that is not among these.
  /// @throws Error for an unknown parameter or key, a value out of range, or a
  ///         configuration file that cannot be read.
  [[nodiscard]] MethodChoice choice(const MethodRegistry& methods) const;
  /// The same with all else that the configuration file says.
  [[nodiscard]] SessionConfig session(const MethodRegistry& methods) const;

  /// Is there a configuration file?
  [[nodiscard]] bool has_file() const { return config_.has_value(); }

 private:
  std::optional<std::string> method_;
  std::vector<std::string> assignments_;
  std::optional<std::string> config_;
};

/// @throws UnknownMethod if no method has that name.
void check_method(const MethodRegistry& methods, const std::string& name);

/// A camera's URI with the option `material`, unless it has one or there is no material.
/// @throws Error if the URI cannot be read, or the name cannot stand in one
std::string with_material(const std::string& uri, const std::optional<std::string>& material);

/// The number that `text` is, whole. @throws Error naming `subject`.
double parse_number(const std::string& subject, const std::string& text);

/// NAME=VALUE taken apart. @throws Error naming `option` if it is none.
std::pair<std::string, double> parse_assignment(const std::string& option, const std::string& text);

}  // namespace palpate::app
