// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "palpate/io/sources/ros_frames.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// Topics by which a camera of palpate's tells the time of its machine to whoever asks:
/// TimeReference, in a question the asker's time, in the answer the time of this machine's wall
/// clock and the question's own time and source.
std::string clock_question_topic(const std::string& camera);
std::string clock_answer_topic(const std::string& camera);
/// Where those that read slices say how they come: Float64MultiArray with what SendRate::report
/// takes.
std::string report_topic(const std::string& camera);

/// Publishes depth images as a camera of ROS 2: /NAME/depth/image_raw/compressedDepth (to the bit),
/// /NAME/depth/camera_info, and the camera's pose in `world` on /tf. Where a raw value is not a
/// millimetre, as ROS takes for granted, the messages' format says so (compressed_depth).
///
/// The same images are on /NAME/depth/image_raw/slices as slices (depth_rvl.hpp), for links that
/// lose packets: best effort, and no more images a second than the link carries. Only what
/// somebody reads is packed. A thread of its own answers what the time is here, and hears how
/// slices come.
class Ros2CameraPublisher {
 public:
  /// @throws Error if `name` is not a valid topic name, or DDS is missing.
  explicit Ros2CameraPublisher(const std::string& name, DepthPacking packing = DepthPacking::rvl);
  ~Ros2CameraPublisher();

  /// @param stamp  [s since 1970] of the capture
  void publish(const DepthImage& image, double stamp);
  /// Of the images, and of the slices.
  [[nodiscard]] const std::string& topic() const;
  [[nodiscard]] const std::string& slices_topic() const;
  [[nodiscard]] std::uint32_t domain() const;
  /// How many read images or slices now.
  [[nodiscard]] int readers() const;

 private:
  struct Topics;
  std::unique_ptr<Topics> topics_;
};

}  // namespace palpate
