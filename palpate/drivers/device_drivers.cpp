// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/device_drivers.hpp"

#include "palpate/drivers/force_dimension.hpp"
#include "palpate/drivers/gamepad.hpp"
#include "palpate/drivers/haply.hpp"
#include "palpate/drivers/open_haptics.hpp"
#include "palpate/drivers/spacenav.hpp"

namespace palpate {

std::vector<Driver> device_drivers() {
  return {force_dimension_driver(), open_haptics_driver(), haply_driver(), spacenav_driver(),
          gamepad_driver()};
}

}  // namespace palpate
