// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/io/bag/messages.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/frame.hpp"
#include "palpate/kernel/cloud/organised.hpp"

// What ROS 2's messages of cameras hold. `name` is the message's, for errors.
namespace palpate {

constexpr std::uint32_t largest_side = 16384;  ///< [px] of an image
constexpr double units_of_16uc1 = 1000.0;      ///< [1/m] REP 118
constexpr double units_of_32fc1 = 5000.0;      ///< [1/m] 0.2 mm, up to 13 m

/// Is it a topic that can be touched? Colour images have the types of depth: of images only topics
/// with "depth" in their name count.
bool is_topic_of_depth(const std::string& topic, const std::string& type);

/// The names in front of a topic of depth: .../depth/image_raw/compressedDepth and
/// .../depth/image_raw have .../depth/camera_info, and librealsense's .../Depth_0/image/data has
/// .../Depth_0/camera_info.
std::string camera_of_topic(const std::string& topic, const std::string& type);

/// Raw values per metre of a depth image: what its format says (see compressed_depth), or ROS's own
/// unit of its encoding. @param format  an Image's encoding, or a CompressedImage's format
/// @throws Error if the format says what cannot be.
double depth_units(const std::string& format, const std::string& name);

/// The colours of an image of rgb8, bgr8, rgba8 or bgra8, row by row: red, green, blue.
/// @throws Error if it is of another encoding, or damaged.
std::vector<std::uint8_t> rgb_of(const ros::Image& image, const std::string& name);

/// @param is_rectified  the images are: the projection counts, not the lens
/// @throws Error if its distortion is neither zero nor Brown and Conrady's.
Intrinsics intrinsics_of(const ros::CameraInfo& info, bool is_rectified, const std::string& name);

/// The other way round.
ros::CameraInfo camera_info_of(const ros::Header& header, const Intrinsics& k);

/// How a message holds compressed depth; both are lossless.
enum class DepthPacking : std::uint8_t {
  png,  ///< every reader knows it
  rvl   ///< many times as fast (depth_rvl.hpp); ROS's own readers know it since Noetic
};

/// A message of compressed_depth_image_transport. A raw value is a millimetre to ROS; where it is
/// something else the format ends in "; units_per_metre=10000", which ROS's own readers pass over.
/// @param packed           16-bit depth, as encode_depth_png or encode_depth_rvl give it
/// @param units_per_metre  raw values per metre
ros::CompressedImage compressed_depth(const ros::Header& header, std::span<const std::byte> packed,
                                      double units_per_metre, DepthPacking packing);

/// A message of a slice of depth. Its format says the unit as that of compressed_depth does.
/// @param slice  of encode_depth_slices
ros::CompressedImage depth_slice(const ros::Header& header, std::span<const std::byte> slice,
                                 double units_per_metre);
/// Is it one?
bool is_depth_slice(const ros::CompressedImage& message);

/// What a message of a camera shows.
struct RosFrame {
  ros::Header header{};
  std::string details{};                      ///< encoding or format
  std::uint32_t width = 0, height = 0;        ///< [px], or of points
  std::vector<std::uint16_t> depth{};         ///< row by row, in `units`
  double units = 0.0;                         ///< [1/m]
  std::optional<std::vector<Vec3>> points{};  ///< instead of depth
  std::vector<std::uint8_t> rgb{};            ///< of the points; empty without

  /// As an image: null if there is none.
  [[nodiscard]] std::shared_ptr<ColourImage> colour() const;
};

/// Depth of 16UC1, mono16 or 32FC1, also compressed by compressed_depth_image_transport; points
/// with x, y and z, of which those that were not measured are not a number.
/// @param type   Image, CompressedImage or PointCloud2
/// @param units  raw values per metre, to which floats are rounded; none: what the message says
/// @throws Error if it is none of depth or points, or damaged.
RosFrame ros_frame_of(std::string_view type, std::span<const std::byte> cdr,
                      const std::optional<double>& units, const std::string& name);

/// The cloud of a frame: a depth image, also of points that a pinhole camera could have seen, or
/// points, of which those with colours are a Surface.
/// @param rays  of the camera, if the frame has depth
std::shared_ptr<const Cloud> cloud_of(RosFrame frame, std::shared_ptr<const ViewingRays> rays,
                                      const Eigen::Isometry3d& pose, OrganisedClouds& organised);

}  // namespace palpate
