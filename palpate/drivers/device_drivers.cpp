// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/device_drivers.hpp"

namespace palpate {

std::vector<Driver> device_drivers() {
  return {};
}

}  // namespace palpate
