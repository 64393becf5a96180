// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// All methods side by side in one table, from the other experiments at reduced size, and what each
/// costs. Costs are measured: they alone differ from run to run.
Experiment methods_experiment();

}  // namespace palpate::lab
