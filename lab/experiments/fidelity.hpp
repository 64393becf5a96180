// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// How near the rendered contact and force are to the true ones, white noise and a real camera's,
/// beside its aims. Takes some seconds a method.
Experiment fidelity_experiment();

}  // namespace palpate::lab
