// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/parameters.hpp"
#include "palpate/viewer/server.hpp"

namespace palpate::app {

struct LiveOptions {
  std::vector<std::string> cameras;
  std::string device = "mouse:";   ///< script: and hand: without a file follow a built-in path
  std::optional<double> duration;  ///< [s]; none: until the person ends it
  double rate = 1000.0;            ///< [Hz] of the servo loop
  ViewerOptions viewer;
  bool any_port_will_do = false;  ///< if another program has viewer.port
  bool open_browser = true;       ///< where there is a desktop
  bool json = false;              ///< the summary as a JSON object
  std::string method = "sight";   ///< the kernel's, or one of the lab's
  Parameters parameters;
  std::string record;  ///< folder of a recording from the start; empty for none
};

/// A session that a person watches and touches: cameras, servo loop and page, until the time is up
/// or SIGINT or SIGTERM comes. Says on standard error where the page is and prints a summary.
/// @return the program's exit code
/// @throws Error if a camera, the device or the page's address cannot be used.
int run_live(const LiveOptions& options);

}  // namespace palpate::app
