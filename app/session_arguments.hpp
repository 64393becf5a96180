// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
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
  std::vector<std::string> cameras_, devices_, limits_, operator_limits_;
  std::optional<std::string> material_, fixtures_, device_pose_, record_, record_folder_;
  std::optional<std::string> listen_, token_, operator_token_;
  std::optional<double> rate_, scale_, bubble_, handle_weight_, record_limit_;
  std::optional<int> clutch_button_;
  std::optional<int> port_;
  bool no_browser_ = false, without_watchdog_ = false;
  MethodOptions method_;
};

/// The options --device-pose, --scale and --clutch-button on a placement.
/// @param pose  "x,y,z,qx,qy,qz,qw" or the TOML file of a session, for its world_from_device
/// @throws Error if one cannot be used.
void apply_placement(const std::optional<std::string>& pose, const std::optional<double>& scale,
                     const std::optional<int>& clutch_button, Placement& placement);

}  // namespace palpate::app
