// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <fstream>
#include <string>

#include "palpate/drivers/dds.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/ros2.hpp"
#include "palpate/servo/realtime.hpp"
#include "palpate/sources/ros_frames.hpp"

namespace palpate {
namespace ros2 {
namespace {

constexpr double needed_buffer = 4e6;   // [bytes] for depth and clouds without loss
constexpr double listening_time = 0.5;  // [s] to hear of who publishes

std::string small_buffer(double bytes) {
  return "the kernel lets a socket keep " + std::to_string(std::lround(bytes / 1000.0)) +
         " kB, and loses images beyond: sudo sysctl -w net.core.rmem_max=8388608";
}

DriverReport look() {
  dds::Participant participant("ros2:");
  DriverReport report{.library = participant.library_path()};
  const double end = monotonic_now() + listening_time;
  for (double left = listening_time; left > 0.0; left = end - monotonic_now())
    participant.wait(left);
  std::ifstream allowed("/proc/sys/net/core/rmem_max");
  double bytes = 0.0;
  const bool is_small = allowed >> bytes && bytes < needed_buffer;
  for (const dds::Publication& one : participant.publications()) {
    if (!is_topic_of_depth(one.topic, one.type)) continue;
    report.found.push_back(
        {.uri = "ros2:" + one.topic,
         .name = one.type + ", in domain " + std::to_string(participant.domain()),
         .note = is_small ? small_buffer(bytes) : ""});
  }
  return report;
}

}  // namespace
}  // namespace ros2

/// `ros2:/TOPIC` as a camera and `ros2:PRESET` as a device: topics of ROS 2 on the network, without
/// ROS (docs/ros.md).
Driver ros2_driver() {
  return {.name = "ros2",
          .summary =
              "ros2:/TOPIC of a camera's depth or points, ros2:fd and others as haptic devices, "
              "on the network of ROS 2",
          .tried = "Cyclone DDS's own writers; no ROS 2 beside it",
          .open_camera = open_ros2_camera,
          .open_device = open_ros2_device,
          .look = reporting(ros2::look),
          .needs_guard = true};
}

}  // namespace palpate
