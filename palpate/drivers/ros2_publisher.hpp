// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "palpate/cloud/depth_image.hpp"

namespace palpate {

/// Publishes depth images as a camera of ROS 2: /NAME/depth/image_raw/compressedDepth (PNG, to the
/// bit), /NAME/depth/camera_info, and the camera's pose in `world` on /tf. Where a raw value is not
/// a millimetre, as ROS takes for granted, /NAME/depth/units_per_metre says what it is, and ros2:
/// reads it.
class Ros2CameraPublisher {
 public:
  /// @throws Error if `name` is none for a topic, or DDS is missing.
  explicit Ros2CameraPublisher(const std::string& name);
  ~Ros2CameraPublisher();

  /// @param stamp  [s since 1970] of the capture
  void publish(const DepthImage& image, double stamp);
  /// Of the images.
  [[nodiscard]] const std::string& topic() const;
  [[nodiscard]] std::uint32_t domain() const;
  /// How many read the images now.
  [[nodiscard]] int readers() const;

 private:
  struct Topics;
  std::unique_ptr<Topics> topics_;
};

}  // namespace palpate
