// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/sources/transforms.hpp"
#include "palpate/kernel/cloud/frame.hpp"

namespace palpate {

/// The colour images that a bag has beside a topic of depth: rgb8, bgr8, rgba8 and bgra8, with a
/// CameraInfo, whose distortion is left out as colour is to be looked at. Where their camera stands
/// is told by librealsense's own transforms, by TF, or by a frame_id that is also that of the
/// depth.
class BagColour {
 public:
  /// Their topic: of several the one whose name is most like that of the depth; empty: there is
  /// none.
  static std::string topic_beside(BagReader& bag, const std::string& depth);

  /// @param bag    must outlive this
  /// @param topic  of the colour images
  /// @param depth  the topic of depth
  /// @param frame  of its images, as their headers name it
  /// @param pose   of the depth camera by TF; null: not used
  /// @throws Error if they cannot be used
  BagColour(BagReader& bag, const std::string& topic, const std::string& depth,
            const std::string& frame, const BagTransforms* pose);

  /// The image nearest in time, by the times of recording; null: none is within 0.1 s, or it is
  /// damaged.
  /// @param nanoseconds  of the depth image
  /// @param stamp        [s] the same image's, for TF
  [[nodiscard]] std::shared_ptr<const ColourImage> at(std::int64_t nanoseconds, double stamp,
                                                      const Eigen::Isometry3d& world_from_depth);

 private:
  [[nodiscard]] std::optional<Eigen::Isometry3d> realsense_pose(const std::string& camera) const;

  BagReader& bag_;
  std::string topic_;
  std::vector<BagReader::Place> places_;
  Intrinsics intrinsics_;
  Eigen::Isometry3d depth_from_colour_ = Eigen::Isometry3d::Identity();  // unless TF tells
  std::optional<BagTransforms> colour_in_, depth_in_;  // depth_in_: where the world is its frame
};

}  // namespace palpate
