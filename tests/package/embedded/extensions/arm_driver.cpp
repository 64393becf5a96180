// SPDX-License-Identifier: Apache-2.0
// A stranger's haptic device: this file, and nothing elsewhere.
#include "palpate/drivers/drivers.hpp"
#include "palpate/io/devices/hip_path.hpp"

namespace palpate {

// Goes 8 mm into what is half a metre before it, and stays.
Driver arm_driver() {
  return {.name = "arm",
          .summary = "an arm that leads itself",
          .tried = "nothing",
          .open_device =
              [](const Uri& uri) {
                const HipPath path({{0.0, Vec3(0.0, 0.0, 0.45)}, {1.0, Vec3(0.0, 0.0, 0.508)}});
                return std::make_unique<ScriptedDevice>(path, false, uri.text());
              },
          .look = [] { return DriverReport{.library = "none"}; }};
}

}  // namespace palpate
