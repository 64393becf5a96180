// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/device_drivers.hpp"

#include "palpate/drivers/force_dimension.hpp"

namespace palpate {

std::vector<Driver> device_drivers() {
  return {force_dimension_driver()};
}

}  // namespace palpate
