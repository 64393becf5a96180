// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/parameters.hpp"

namespace palpate {

/// What points without an image are like for a hand, and how they can be felt.
struct ProposedTouch {
  double extent = 0.0;   ///< [m] longest side of the box about them
  double spacing = 0.0;  ///< [m] between neighbours, as on a square grid; 0: they are too few
  /// [m] r_c of a proxy that they carry as they are, the usual one at least; the usual one where
  /// none is large enough: it rests on a single point more steadily than a large one on a few.
  double radius = 0.0;
  /// [-] by which their lengths are to be multiplied, a power of ten: not 1 where no proxy is
  /// large enough for the spacing, or all is smaller than the usual one.
  double scale = 1.0;
};

/// Looks at some hundreds of the points, and at the box about all.
ProposedTouch proposed_touch(const PointCloud& cloud);

/// Is this the name of one of the proxy's radii?
[[nodiscard]] inline bool is_proxy_radius(std::string_view parameter) {
  return parameter.substr(0, 2) == "r_";
}

/// Parameters of a method that touches what cameras see, where nobody chose the radii and r_c is
/// the usual one: if all of them see points without an image, as proposed for the widest spacing.
Parameters for_points(Parameters parameters, std::span<const Cloud* const> seen);

}  // namespace palpate
