// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// The field set: scenes, sensors and hands that share no code with the generator that methods were
/// made with. docs/field.md has the rules.
Experiment field_experiment();

}  // namespace palpate::lab
