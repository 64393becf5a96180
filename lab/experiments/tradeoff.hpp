// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// What stillness costs: how far a contact lags behind a surface that begins to move, against how
/// much it jitters while the surface rests, before a D4xx; beside plain means of the last N frames.
Experiment tradeoff_experiment();

}  // namespace palpate::lab
