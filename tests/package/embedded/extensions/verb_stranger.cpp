// SPDX-License-Identifier: Apache-2.0
// A stranger's verb: this file, and nothing elsewhere.
#include <cstdio>

#include <CLI/CLI.hpp>

#include "app/verbs.hpp"

namespace palpate::app {

Verb add_stranger(CLI::App& program) {
  CLI::App* command = program.add_subcommand("stranger", "greet");
  return {command, [] {
            std::puts("a stranger's verb");
            return 0;
          }};
}

}  // namespace palpate::app
