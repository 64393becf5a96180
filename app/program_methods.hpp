// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/method.hpp"
#include "palpate/sources/source.hpp"

namespace palpate::app {

/// The methods that this program knows by name.
/// @param camera  what will be touched, for `ideal`, which needs the truth; null: not known
MethodRegistry program_methods(const Source* camera = nullptr);

}  // namespace palpate::app
