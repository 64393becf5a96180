// SPDX-License-Identifier: Apache-2.0
#include "app/program.hpp"
#include "palpate/kernel/methods/methods.hpp"

namespace palpate::app {

MethodRegistry program_methods(const Source* /*camera*/) { return standard_methods(); }

}  // namespace palpate::app
