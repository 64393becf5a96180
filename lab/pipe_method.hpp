// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <memory>
#include <string_view>

#include "lab/method.hpp"

namespace palpate::lab {

/// Does a method's name ask for a program behind a pipe, `pipe:COMMAND`?
bool is_pipe(std::string_view name);

/// A method that is a program of its own: frames and HIPs go to its standard input, its ticks come
/// from its standard output, as docs/bench-entries.md has it. The shell runs the command, once for
/// each object, and all of it is killed with the object.
/// @param name      `pipe:COMMAND`
/// @param patience  how long an answer may take
/// @throws Error if it cannot be started, or does not answer what the format asks for.
std::unique_ptr<Method> make_pipe_method(
    std::string_view name, const Parameters& parameters,
    std::chrono::milliseconds patience = std::chrono::seconds(10));

}  // namespace palpate::lab
