// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/core/parameters.hpp"
#include "palpate/session/paint.hpp"
#include "palpate/teleop/touched.hpp"

namespace palpate {

constexpr double touched_radius = 0.02;  ///< [m] about the place that is taken to be alike

/// Makes what a robot's tool found out the material of the surface there, where it is softer than
/// what is rendered, or where friction is known. A place that was found hard, or that a person has
/// painted, stays as it is. Materials change as those of a brush do: never by a step, and harder
/// only as far as somebody pays for it (docs/materials.md).
/// @param parameters  of the session: all but stiffness and friction is theirs
/// @return why nothing was done; empty: it was
std::string paint_touched(Paint& paint, const Parameters& parameters, const Touched& touched);

}  // namespace palpate
