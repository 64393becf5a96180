// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "palpate/kernel/core/method.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"

namespace palpate {

/// The default method of library and programs.
inline constexpr std::string_view default_method = "sight";

/// The library's methods, in the order in which they are shown, and those of PALPATE_EXTENSIONS: of
/// files NAME_method.cpp with a function `MethodInfo NAME_method()`. A program adds to a copy.
const MethodRegistry& standard_methods();

/// A method by its name, with what surfaces feel like around it (`Feel`).
/// @param tool  what it touches with; null: a ball. Surfaces feel like nothing else to other tools.
/// @throws Error for an unknown name, naming the nearest and listing all, if the parameters do not
///         validate, or if the method cannot touch with the tool.
std::unique_ptr<Method> make_method(std::string_view name = default_method,
                                    const Parameters& parameters = {},
                                    const MethodRegistry& methods = standard_methods(),
                                    std::shared_ptr<const ToolShape> tool = nullptr);

}  // namespace palpate
