// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/camera_drivers.hpp"

#include "palpate/drivers/freenect_camera.hpp"
#include "palpate/drivers/openni2_camera.hpp"
#include "palpate/drivers/realsense_camera.hpp"
#include "palpate/drivers/ros2.hpp"
#include "palpate/drivers/v4l2_camera.hpp"

namespace palpate {

std::vector<Driver> camera_drivers() {
  return {realsense_driver(), openni2_driver(), freenect_driver(), v4l2_driver(), ros2_driver()};
}

}  // namespace palpate
