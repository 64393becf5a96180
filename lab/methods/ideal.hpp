// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "lab/method.hpp"

namespace palpate::lab {

/// The ruler: a sphere of radius r_c that rests on the true surface, followed continuously in
/// time, coupled to the HIP by (16). Needs `setup.truth`; @throws Error without it.
std::unique_ptr<TouchMethod> make_ideal(const MethodSetup& setup);

}  // namespace palpate::lab
