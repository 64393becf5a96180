// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "lab/ticks.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate::lab {

/// The moving-least-squares plane at the middle of a patch [7]: a = sum w x / sum w, and as normal
/// the eigenvector of the weighted covariance with the smallest eigenvalue, towards where the
/// points were seen from (else up). None for less than six points.
/// @param radius  [m] w is Wendland's function down to 0 there
std::optional<Contact> fit_plane(const Patch& patch, double radius);

}  // namespace palpate::lab
