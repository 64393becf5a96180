// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/servo/workspace.hpp"

namespace palpate {

using PlacementInfo = ParameterRow<Placement>;

/// Scale, origin, angles, bubble and handle of a placement, in the order in which they are shown.
/// The angles turn about the world's x, then y, then z axis.
std::span<const PlacementInfo> placement_table();

/// Sets one of them by name; the others stay.
/// @throws Error for an unknown name (naming the nearest) or a value out of its range.
void set_placement(Placement& placement, std::string_view name, double value);

}  // namespace palpate
