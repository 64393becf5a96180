// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "lab/method.hpp"

namespace palpate::lab {

/// The direct method of section 2.1 on the surface of [7]: a force in proportion to the depth of
/// the HIP below a moving-least-squares plane, no proxy and no memory.
std::unique_ptr<TouchMethod> make_direct(const MethodSetup& setup);

}  // namespace palpate::lab
