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

/// The options that choose a method and its parameters, the same for every verb that renders.
/// Order of precedence: defaults, --config, --method and --set.
class MethodOptions {
 public:
  /// Adds --method, --set and --config.
  void add_to(CLI::App& command);
  /// The same without --method.
  void add_parameters_to(CLI::App& command);

  /// With all else that the configuration file says.
  /// @throws UnknownMethod for a method that is not among these.
  /// @throws Error for an unknown parameter or key, a value out of range, or a
  ///         configuration file that cannot be read.
  [[nodiscard]] SessionConfig session(const MethodRegistry& methods) const;

  /// Is there a configuration file?
  [[nodiscard]] bool has_file() const { return config_.has_value(); }

 private:
  std::optional<std::string> method_;
  std::vector<std::string> assignments_;
  std::optional<std::string> config_;
};

/// The options that describe a session, the same as the keys of its file.
/// Order of precedence: defaults, --config, all others.
class SessionArguments {
 public:
  void add_to(CLI::App& command);

  /// @throws Error for an unknown name or a value out of range, naming the option or FILE:LINE.
  /// Are cameras named, and not left to the usual one? Those of --config count as named.
  [[nodiscard]] bool names_cameras() const;
  [[nodiscard]] SessionConfig config(const MethodRegistry& methods) const;

 private:
  const CLI::App* command_ = nullptr;  // whose options they are
  SessionConfig given_;                // where it puts the values of keys
  std::vector<std::string> cameras_, devices_, limits_, operator_limits_;
  std::optional<std::string> material_, device_pose_;
  bool no_browser_ = false;
  MethodOptions method_;
};

/// Adds an option that may be given several times, each with one value.
inline CLI::Option* add_repeated(CLI::App& command, const std::string& name,
                                 std::vector<std::string>& values, const std::string& help) {
  return command.add_option(name, values, help)->allow_extra_args(false);
}

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
