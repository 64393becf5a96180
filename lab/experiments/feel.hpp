// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// What a hand feels with a method, in the open loop, with a device and a hand in the loop, and
/// through the safety chain, beside the aims. docs/feel.md says what is measured, and how.
Experiment feel_experiment();

}  // namespace palpate::lab
