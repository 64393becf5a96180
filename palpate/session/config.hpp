// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "palpate/session/session_spec.hpp"

namespace palpate {

/// The page's server.
struct ServerConfig {
  std::string listen = "127.0.0.1";        ///< address; this default lets in this machine alone
  std::optional<std::uint16_t> port = {};  ///< none: 8642, or any free one; 0: any free one
  std::string token = {};                  ///< what a page must know; empty: none is asked for
  std::string operator_token = {};         ///< the operator's page's; empty: one is made
  bool browser = true;                     ///< open one at the start, where there is a desktop
};

/// A session of the program as one TOML file describes it. docs/session.md lists the keys.
struct SessionConfig : SessionSpec {
  SessionConfig() { cameras = {{.uri = "synthetic:desk?noise=1mm"}}; }

  std::string record_folder = {};  ///< folder of recordings started on the page; empty: the current
  double record_limit = 20.0;      ///< [GB] of all recordings of a session that pages start
  /// Per safety limit: the least strict value that the operator may set on the page; default: the
  /// end of its range.
  std::map<std::string, double> operator_limits = {};
  ServerConfig server;
};

/// Throws Error if there is no method of that name; for what the file names.
using MethodCheck = std::function<void(const std::string& name)>;

/// Reads a session's TOML file. What it leaves out is taken from `base`.
/// @throws Error naming FILE:LINE for a file that cannot be read or is no TOML, an unknown key
///         (naming the nearest known one), a value of another type or out of range.
SessionConfig read_session_config(const std::filesystem::path& file, const SessionConfig& base = {},
                                  const MethodCheck& check_method = {});

/// The same from a text. @param name  of the file, for messages
SessionConfig parse_session_config(std::string_view text, const std::string& name,
                                   const SessionConfig& base = {},
                                   const MethodCheck& check_method = {});

/// The TOML file of a configuration, every key with its unit and range in a comment.
/// parse_session_config gives back the same values bit for bit, but for the rounding of the poses'
/// quaternions.
std::string to_toml(const SessionConfig& config);

/// A session's TOML text with another placement, and everything else, comments included, as it is.
/// @param text  may be empty
/// @param name  of the file, for messages
/// @throws Error as parse_session_config, or if the [placement] table is written in a way that
///         cannot be edited (an inline table).
std::string with_placement(std::string_view text, const std::string& name,
                           const Placement& placement);

/// @throws Error if a pose, the placement, a parameter or the rate is out of range.
void validate(const SessionConfig& config);

}  // namespace palpate
