// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// A resting plane under fresh noise in every frame: is it lost, and what does the hand feel?
Experiment hold_experiment();
/// What the hand feels while the surface moves: 1 Hz, 20 mm.
Experiment force_experiment();
/// Section 4.6: what damping does to a hand that goes back and forth in a resting plane.
Experiment damping_experiment();

}  // namespace palpate::lab
