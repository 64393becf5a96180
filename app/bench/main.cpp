// SPDX-License-Identifier: Apache-2.0
// palpate-bench: what a tick costs on this machine.
#include <array>

#include "app/program.hpp"

namespace palpate::app {
Verb add_bench(CLI::App& program);
}

int main(int argc, char** argv) {
  constexpr std::array<palpate::app::AddVerb, 1> own = {palpate::app::add_bench};
  return palpate::app::run_program(argc, argv, own);
}
