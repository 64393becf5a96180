// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/camera_drivers.hpp"

namespace palpate {

std::vector<Driver> camera_drivers() {
  return {};
}

}  // namespace palpate
