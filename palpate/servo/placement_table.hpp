// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

#include "palpate/servo/workspace.hpp"

namespace palpate {

/// One number of a placement, for sliders and options.
struct PlacementInfo {
  std::string_view name;
  std::string_view unit;
  double default_value;
  double min;
  double max;
  std::string_view meaning;
  double (*get)(const Placement&);
  void (*set)(Placement&, double);
};

/// Scale, origin and angles of a placement, in the order in which they are shown. The angles turn
/// about the world's x, then y, then z axis.
std::span<const PlacementInfo> placement_table();

/// Sets one of them by name; the others stay.
/// @throws Error for an unknown name (naming the nearest) or a value out of its range.
void set_placement(Placement& placement, std::string_view name, double value);

}  // namespace palpate
