// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

/// Fig. 12: one lift over time.
Experiment single_lift_experiment();
/// Section 5.2: a flat cloud rises at 20 r_c/s to the proxy, then accelerates for 10 frames.
Experiment lift_experiment();
/// Section 6: h and e_n of (23) and (24), and the bound (25).
Experiment bound_experiment();
/// The highest velocity at which a flat cloud can rise.
Experiment speed_experiment();
/// A flat cloud that comes out of free space at a constant velocity.
Experiment first_contact_experiment();

}  // namespace palpate::lab
