// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lab/experiment.hpp"

namespace palpate::lab {

struct PopCase;

/// Is the surface lost in a case? Nothing is shrunk: for tables of many methods.
bool is_lost(const std::string& method, const PopCase& c, const Parameters& parameters);

/// Does a method keep the proxy on the right side? Families of cases drawn by chance, each failure
/// shrunk to the simplest case that still fails. docs/pop.md has the rules.
Experiment pop_experiment();

}  // namespace palpate::lab
