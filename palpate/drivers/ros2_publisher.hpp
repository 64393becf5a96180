// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

#include "palpate/drivers/dds.hpp"
#include "palpate/drivers/link_estimates.hpp"
#include "palpate/io/sources/ros_frames.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// Topics by which a camera of palpate's tells the time of its machine to whoever asks:
/// TimeReference, in a question the asker's time, in the answer the time of this machine's wall
/// clock and the question's own time and source.
std::string clock_question_topic(const std::string& camera);
std::string clock_answer_topic(const std::string& camera);
/// Where readers of slices say how they come: Float64MultiArray of what SendRate::report takes.
std::string report_topic(const std::string& camera);

/// Publishes depth images as a camera of ROS 2: /NAME/depth/image_raw/compressedDepth (to the bit),
/// /NAME/depth/camera_info, and the camera's pose in `world` on /tf. Where a raw value is not a
/// millimetre, as ROS takes for granted, the messages' format says so (compressed_depth).
///
/// The same images are on /NAME/depth/image_raw/slices as slices (depth_rvl.hpp), for links that
/// lose packets: best effort, and no more images a second than the link carries. Only what somebody
/// reads is packed. A thread of its own tells the time, and hears how slices come.
class Ros2CameraPublisher {
 public:
  /// @throws Error if `name` is not a valid topic name, or DDS is missing.
  explicit Ros2CameraPublisher(const std::string& name, DepthPacking packing = DepthPacking::rvl);
  ~Ros2CameraPublisher();

  /// @param stamp  [s since 1970] of the capture
  void publish(const DepthImage& image, double stamp);
  /// Of the images, and of the slices.
  [[nodiscard]] const std::string& topic() const { return topic_; }
  [[nodiscard]] const std::string& slices_topic() const { return slices_topic_; }
  [[nodiscard]] std::uint32_t domain() const { return participant_.domain(); }
  /// How many read images or slices now.
  [[nodiscard]] int readers() const { return images_.readers() + slices_.readers(); }

 private:
  void listen();
  int copies_wanted();

  std::string name_;
  DepthPacking packing_;
  dds::Participant participant_;
  std::string camera_, topic_, slices_topic_;
  // Others hear of them in this order: whoever has heard of the images has heard of all.
  dds::Reader questions_;
  dds::Writer answers_;
  dds::Reader reports_;
  dds::Writer transforms_, lenses_, images_, slices_;
  std::mutex rate_mutex_;
  SendRate rate_;             // guarded by it
  std::uint32_t number_ = 0;  // of an image in slices
  std::atomic<bool> ends_{false};
  std::thread listener_;
};

}  // namespace palpate
