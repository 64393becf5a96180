// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

namespace CLI {
class App;
}

namespace palpate::app {

/// What a verb does once its arguments are parsed; the program's exit code. Throws palpate::Error
/// for wrong usage or input (exit 2), anything else for a failure while running (exit 1).
using Action = std::function<int()>;

/// One word of the command line: adds itself to the program and says what to do.
struct Verb {
  CLI::App* command;
  Action action;
};
using AddVerb = Verb (*)(CLI::App& program);

/// The programs' common verbs: what verb_NAME.cpp gives by `Verb
/// palpate::app::add_NAME(CLI::App&)`.
std::vector<AddVerb> listed_verbs();

/// The verb that a newcomer needs first.
Verb add_run(CLI::App& program);

}  // namespace palpate::app
