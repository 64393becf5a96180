// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "lab/method.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate::app {

/// Any method by its name, as the servo loop asks for it: the kernel's own as they are; those of
/// the lab without their promises, as their frames and ticks allocate and take the time that they
/// take.
/// @param seen  what it will be given: tried before it is promised
/// @throws Error if there is no such method, it needs the truth, or it cannot touch what is seen.
std::unique_ptr<Rendering> open_rendering(const std::string& method, const Parameters& parameters,
                                          const std::vector<std::shared_ptr<const Cloud>>& seen);

/// Is it the library's own, with all that it promises?
[[nodiscard]] bool is_of_the_kernel(std::string_view method);

/// The methods that a session can run: all but the lab's ruler, which needs the truth.
[[nodiscard]] std::vector<lab::MethodInfo> live_methods();

}  // namespace palpate::app
