// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

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

Verb add_run(CLI::App& program);
Verb add_trace(CLI::App& program);
Verb add_info(CLI::App& program);
Verb add_replay(CLI::App& program);
Verb add_doctor(CLI::App& program);
Verb add_methods(CLI::App& program);
Verb add_parameters(CLI::App& program);
Verb add_calibrate(CLI::App& program);
Verb add_serve_camera(CLI::App& program);
Verb add_ros(CLI::App& program);
Verb add_teleop(CLI::App& program);

}  // namespace palpate::app
