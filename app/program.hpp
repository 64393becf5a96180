// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "app/verbs.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/method.hpp"

namespace palpate::app {

/// The whole of a program: parses the command line and runs its verb. The programs `palpate`,
/// `palpate-lab` and `palpate-bench` share all verbs but their own, and give `program_methods` as
/// they link it. A verb or method of another program is handed to that program if it lies beside
/// this one.
/// @param own_verbs  verbs that this program alone has
/// @return the exit status: 0 done, 1 failed while running, 2 wrong usage or input, 128 and a
///         signal's number where that signal ended work before it was whole
int run_program(int argc, char** argv, std::span<const AddVerb> own_verbs = {});

/// The methods that this program knows by name.
/// @param camera  what will be touched, for `ideal`, which needs the truth; null: not known
MethodRegistry program_methods(const Source* camera = nullptr);

/// A method that this program does not know; palpate-lab may.
class UnknownMethod : public Error {
 public:
  explicit UnknownMethod(const Error& error) : Error(error) {}
};

}  // namespace palpate::app
