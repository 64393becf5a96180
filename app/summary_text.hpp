// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/session/summary.hpp"

namespace palpate::app {

/// A summary in one line, for people.
std::string text_of(const Summary& summary);
/// The same as a JSON object, SI units.
/// @param recording  how it went; empty: there was none
std::string json_of(const Summary& summary, const std::string& recording = {});

}  // namespace palpate::app
