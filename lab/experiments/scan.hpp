// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// Section 5.4, Fig. 16: over a ramp and a box as a Kinect sees them, or across a recording.
Experiment scan_experiment();

}  // namespace palpate::lab
