// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/session/summary.hpp"

namespace palpate::app {

/// A summary in one line, for people.
std::string text_of(const Summary& summary);
/// The same as a JSON object, SI units.
std::string json_of(const Summary& summary);

}  // namespace palpate::app
