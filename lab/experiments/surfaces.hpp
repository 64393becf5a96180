// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// Section 5.1, Fig. 11: the HIP goes along a flat grid, above it and below it.
Experiment flat_experiment();
/// Section 5.1: ticks and steps to the surface after the HIP jumps below it.
Experiment jump_experiment();
/// Section 5.3, Fig. 14: a triangle wave whose amplitude grows.
Experiment corners_experiment();

}  // namespace palpate::lab
