// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "app/program.hpp"
#include "app/verbs.hpp"

namespace palpate::app {

Verb add_methods(CLI::App& program) {
  CLI::App* command = program.add_subcommand("methods", "list the methods for --method");
  const auto names = std::make_shared<bool>(false);
  command->add_flag("--names", *names, "only the names, in one line");
  return {command, [names] {
            const MethodRegistry methods = program_methods();
            for (const MethodInfo& method : methods.entries()) {
              const std::string name(method.name);
              if (*names) {
                std::printf("%s%s", &method == &methods.entries().front() ? "" : " ", name.c_str());
              } else {
                std::printf("%-20s %s\n", name.c_str(), std::string(method.summary).c_str());
              }
            }
            if (*names) std::puts("");
            return 0;
          }};
}

}  // namespace palpate::app
