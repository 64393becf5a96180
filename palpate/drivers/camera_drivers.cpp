// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/camera_drivers.hpp"

#include "palpate/drivers/realsense_camera.hpp"

namespace palpate {

std::vector<Driver> camera_drivers() {
  return {realsense_driver()};
}

}  // namespace palpate
