// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "palpate/kernel/core/method.hpp"

namespace palpate {

/// The default method of library and programs.
inline constexpr std::string_view default_method = "sight";

/// The library's methods, in the order in which they are shown, and those of PALPATE_EXTENSIONS: of
/// files NAME_method.cpp with a function `MethodInfo NAME_method()`. A program adds to a copy.
const MethodRegistry& standard_methods();

/// A method by its name, with what surfaces feel like around it (`Feel`).
/// @throws Error for an unknown name, naming the nearest and listing all, or if the parameters do
///         not validate.
std::unique_ptr<Method> make_method(std::string_view name = default_method,
                                    const Parameters& parameters = {},
                                    const MethodRegistry& methods = standard_methods());

}  // namespace palpate
