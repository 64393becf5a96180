// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// What a hand on a known way feels of each of the standard materials: a strike, a slow press and a
/// stroke, through the whole chain.
Experiment materials_experiment();

}  // namespace palpate::lab
