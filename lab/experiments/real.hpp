// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// Pressing, holding and sliding on what a real camera measured, at rest and moved exactly: patches
/// cut out of the recorded frames, with their noise, are moved along or across the lines of sight.
Experiment real_experiment();

}  // namespace palpate::lab
