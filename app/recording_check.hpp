// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/io/bag/bag_reader.hpp"

namespace palpate::app {

/// What the checksums of a recording say, in a line without its end.
std::string text_of(const BagCheck& check);

}  // namespace palpate::app
