// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/ros2.hpp"

#include "palpate/drivers/dds.hpp"
#include "palpate/drivers/ros2_camera.hpp"
#include "palpate/servo/realtime.hpp"
#include "palpate/sources/ros_frames.hpp"

namespace palpate {
namespace ros2 {
namespace {

constexpr double listening_time = 0.5;  // [s] to hear of who publishes

DriverReport look() {
  dds::Participant participant("ros2:");
  DriverReport report{.library = participant.library_path()};
  const double end = monotonic_now() + listening_time;
  for (double left = listening_time; left > 0.0; left = end - monotonic_now())
    participant.wait(left);
  for (const dds::Publication& one : participant.publications()) {
    if (!is_topic_of_depth(one.topic, one.type)) continue;
    report.found.push_back(
        {.uri = "ros2:" + one.topic,
         .name = one.type + ", in domain " + std::to_string(participant.domain())});
  }
  return report;
}

}  // namespace
}  // namespace ros2

Driver ros2_driver() {
  return {.name = "ros2",
          .summary = "ros2:/TOPIC of a camera's depth or points, on the network of ROS 2",
          .tried = "Cyclone DDS's own writers; no ROS 2 beside it",
          .open_camera = open_ros2_camera,
          .look = reporting(ros2::look)};
}

}  // namespace palpate
