// SPDX-License-Identifier: Apache-2.0
// A driver as a stranger adds one: this file, and nothing elsewhere.
#include "palpate/drivers/drivers.hpp"
#include "palpate/io/devices/hip_path.hpp"

namespace palpate {

Driver stranger_driver() {
  return {.name = "stranger",
          .summary = "an arm that stands still",
          .tried = "nothing",
          .open_device =
              [](const Uri& uri) {
                return std::make_unique<ScriptedDevice>(HipPath({{0.0, Vec3(1.0, 2.0, 3.0)}}),
                                                        false, uri.text());
              },
          .look = [] { return DriverReport{.library = "none"}; }};
}

}  // namespace palpate
