// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/method.hpp"

namespace palpate::app {

/// The methods that this program knows by name.
/// @param camera  what will be touched, for `ideal`, which needs the truth; null: not known
MethodRegistry program_methods(const Source* camera = nullptr);

}  // namespace palpate::app
