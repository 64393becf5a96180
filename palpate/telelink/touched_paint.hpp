// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/core/parameters.hpp"
#include "palpate/session/paint.hpp"
#include "palpate/teleop/touched.hpp"

namespace palpate {

constexpr double touched_radius = 0.02;  ///< [m] around the contact that gets the same material

/// Assigns the stiffness and friction measured by a robot's tool to the surface there, if the
/// stiffness is lower than the rendered one, or if friction is known. Surfaces that were measured
/// stiffer, or painted by a user, are not changed. Materials change as with the brush: never in a
/// step, and stiffer only with energy from the tank (docs/materials.md). @param parameters of the
/// session: used for all but stiffness and friction
/// @return why nothing was done; empty: it was
std::string paint_touched(Paint& paint, const Parameters& parameters, const Touched& touched);

}  // namespace palpate
