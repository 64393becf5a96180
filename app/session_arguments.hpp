// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "app/options.hpp"
#include "palpate/session/config.hpp"

namespace palpate::app {

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

}  // namespace palpate::app
