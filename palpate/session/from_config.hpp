// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/session/config.hpp"
#include "palpate/session/session.hpp"

namespace palpate {

/// The options of the session that a configuration describes. An empty device is left as
/// SessionOptions has it; the server is the program's.
/// @throws Error as validate(config).
SessionOptions session_options(const SessionConfig& config);

}  // namespace palpate
