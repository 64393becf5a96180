// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace palpate::app {

/// What `doctor --device` is asked for.
struct DeviceCheck {
  std::string uri;
  bool agreed = false;            ///< the person beside the device has
  bool without_watchdog = false;  ///< an emergency stop is at hand
  bool json = false;
};

/// Measures a device by its own motors, with consent, and prints what it found.
/// @return the program's exit code
/// @throws Error if nobody agreed, or the device cannot be measured.
int check_device(const DeviceCheck& check);

}  // namespace palpate::app
