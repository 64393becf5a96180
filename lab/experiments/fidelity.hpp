// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// How near the rendered contact and force are to the true ones, white noise and a real camera's,
/// beside what is aimed at. Some seconds a method: the ruler for work on a method.
Experiment fidelity_experiment();

}  // namespace palpate::lab
