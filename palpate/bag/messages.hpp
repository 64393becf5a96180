// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

// The messages of ROS 2's standard packages that a recording is made of; fields in the order and
// under the names of their definitions, units as ROS has them (REP 103). Each type has
//   std::vector<std::byte> encode(const TYPE&)        as it lies in a bag
//   decode<TYPE>(bytes, name)                         the same back; throws Error if it is damaged
namespace palpate::ros {

/// builtin_interfaces/msg/Time. ROS counts from 1970 on the clock of the wall.
struct Time {
  std::int32_t sec = 0;       ///< [s]
  std::uint32_t nanosec = 0;  ///< [ns] below 10^9

  [[nodiscard]] std::int64_t nanoseconds() const {
    return std::int64_t{1'000'000'000} * sec + nanosec;
  }
  /// Wrapped into what the fields can hold.
  static Time at(std::int64_t nanoseconds);
};

struct Header {
  Time stamp;
  std::string frame_id;
};

struct Image {
  static constexpr std::string_view type = "sensor_msgs/msg/Image";
  Header header;
  std::uint32_t height = 0, width = 0;  ///< [px]
  std::string encoding;                 ///< such as 16UC1 [mm], 32FC1 [m]
  std::uint8_t is_bigendian = 0;
  std::uint32_t step = 0;  ///< [bytes] of a row
  std::vector<std::byte> data;
};

struct CompressedImage {
  static constexpr std::string_view type = "sensor_msgs/msg/CompressedImage";
  Header header;
  std::string format;  ///< such as "16UC1; compressedDepth png"
  std::vector<std::byte> data;
};

struct CameraInfo {
  static constexpr std::string_view type = "sensor_msgs/msg/CameraInfo";
  Header header;
  std::uint32_t height = 0, width = 0;  ///< [px]
  std::string distortion_model;         ///< plumb_bob (5 of D), rational_polynomial (8)
  std::vector<double> d;
  std::array<double, 9> k{};   ///< fx 0 cx, 0 fy cy, 0 0 1 [px]
  std::array<double, 9> r{};   ///< rectification
  std::array<double, 12> p{};  ///< projection
  std::uint32_t binning_x = 0, binning_y = 0;
  std::array<std::uint32_t, 4> roi{};  ///< x_offset y_offset height width
  bool do_rectify = false;
};

struct PointField {
  std::string name;
  std::uint32_t offset = 0;   ///< [bytes] in a point
  std::uint8_t datatype = 0;  ///< 7 float32, 8 float64
  std::uint32_t count = 1;
};

struct PointCloud2 {
  static constexpr std::string_view type = "sensor_msgs/msg/PointCloud2";
  Header header;
  std::uint32_t height = 1, width = 0;
  std::vector<PointField> fields;
  bool is_bigendian = false;
  std::uint32_t point_step = 0, row_step = 0;  ///< [bytes]
  std::vector<std::byte> data;
  bool is_dense = true;
};

struct PoseStamped {
  static constexpr std::string_view type = "geometry_msgs/msg/PoseStamped";
  Header header;
  std::array<double, 3> position{};                       ///< [m]
  std::array<double, 4> orientation{0.0, 0.0, 0.0, 1.0};  ///< x y z w
};

struct WrenchStamped {
  static constexpr std::string_view type = "geometry_msgs/msg/WrenchStamped";
  Header header;
  std::array<double, 3> force{}, torque{};  ///< [N], [N m]
};

/// What another clock says.
struct TimeReference {
  static constexpr std::string_view type = "sensor_msgs/msg/TimeReference";
  Header header;  ///< stamp: by the clock of the sender
  Time time_ref;  ///< by the other one
  std::string source;
};

struct Transform {
  static constexpr std::string_view type = "geometry_msgs/msg/Transform";
  std::array<double, 3> translation{};                 ///< [m]
  std::array<double, 4> rotation{0.0, 0.0, 0.0, 1.0};  ///< x y z w
};

struct TransformStamped {
  Header header;  ///< frame_id: the parent
  std::string child_frame_id;
  std::array<double, 3> translation{};                 ///< [m]
  std::array<double, 4> rotation{0.0, 0.0, 0.0, 1.0};  ///< x y z w
};

struct TFMessage {
  static constexpr std::string_view type = "tf2_msgs/msg/TFMessage";
  std::vector<TransformStamped> transforms;
};

/// One dimension, labelled.
struct Float64MultiArray {
  static constexpr std::string_view type = "std_msgs/msg/Float64MultiArray";
  std::string label;
  std::vector<double> data;
};

struct Float32 {
  static constexpr std::string_view type = "std_msgs/msg/Float32";
  float data = 0.0F;
};

struct KeyValue {
  static constexpr std::string_view type = "diagnostic_msgs/msg/KeyValue";
  std::string key, value;
};

struct String {
  static constexpr std::string_view type = "std_msgs/msg/String";
  std::string data;
};

struct Bool {
  static constexpr std::string_view type = "std_msgs/msg/Bool";
  bool data = false;
};

struct Point {
  static constexpr std::string_view type = "geometry_msgs/msg/Point";
  std::array<double, 3> xyz{};
};

struct Vector3 {
  static constexpr std::string_view type = "geometry_msgs/msg/Vector3";
  std::array<double, 3> xyz{};
};

struct Wrench {
  static constexpr std::string_view type = "geometry_msgs/msg/Wrench";
  std::array<double, 3> force{}, torque{};  ///< [N], [N m]
};

/// Of the Touch drivers of the omni_common line.
struct OmniFeedback {
  static constexpr std::string_view type = "omni_msgs/msg/OmniFeedback";
  std::array<double, 3> force{}, position{};  ///< [N], of a lock that only old drivers have
};

std::vector<std::byte> encode(const Image& message);
std::vector<std::byte> encode(const CompressedImage& message);
std::vector<std::byte> encode(const CameraInfo& message);
std::vector<std::byte> encode(const PointCloud2& message);
std::vector<std::byte> encode(const PoseStamped& message);
std::vector<std::byte> encode(const WrenchStamped& message);
std::vector<std::byte> encode(const TimeReference& message);
std::vector<std::byte> encode(const Transform& message);
std::vector<std::byte> encode(const TFMessage& message);
std::vector<std::byte> encode(const Float64MultiArray& message);
std::vector<std::byte> encode(const Float32& message);
std::vector<std::byte> encode(const KeyValue& message);
std::vector<std::byte> encode(const String& message);
std::vector<std::byte> encode(const Bool& message);
std::vector<std::byte> encode(const Point& message);
std::vector<std::byte> encode(const Vector3& message);
std::vector<std::byte> encode(const Wrench& message);
std::vector<std::byte> encode(const OmniFeedback& message);

/// A message of ROS 1, in CDR. Known are Image, CompressedImage, CameraInfo, PointCloud2,
/// Transform, TFMessage, Float32, KeyValue and String.
/// @param type  as ROS 2 names it  @param name  of the message, for errors
/// @throws Error if it is of another type, or damaged.
std::vector<std::byte> from_ros1(std::string_view type, std::span<const std::byte> bytes,
                                 const std::string& name);

/// @param name  of the message, for errors  @throws Error if it is damaged.
template <class Message>
Message decode(std::span<const std::byte> bytes, const std::string& name);

template <>
Image decode(std::span<const std::byte> bytes, const std::string& name);
template <>
CompressedImage decode(std::span<const std::byte> bytes, const std::string& name);
template <>
CameraInfo decode(std::span<const std::byte> bytes, const std::string& name);
template <>
PointCloud2 decode(std::span<const std::byte> bytes, const std::string& name);
template <>
PoseStamped decode(std::span<const std::byte> bytes, const std::string& name);
template <>
WrenchStamped decode(std::span<const std::byte> bytes, const std::string& name);
template <>
TimeReference decode(std::span<const std::byte> bytes, const std::string& name);
template <>
Transform decode(std::span<const std::byte> bytes, const std::string& name);
template <>
TFMessage decode(std::span<const std::byte> bytes, const std::string& name);
template <>
Float64MultiArray decode(std::span<const std::byte> bytes, const std::string& name);
template <>
Float32 decode(std::span<const std::byte> bytes, const std::string& name);
template <>
KeyValue decode(std::span<const std::byte> bytes, const std::string& name);
template <>
String decode(std::span<const std::byte> bytes, const std::string& name);
template <>
Bool decode(std::span<const std::byte> bytes, const std::string& name);
template <>
Point decode(std::span<const std::byte> bytes, const std::string& name);
template <>
Vector3 decode(std::span<const std::byte> bytes, const std::string& name);
template <>
Wrench decode(std::span<const std::byte> bytes, const std::string& name);
template <>
OmniFeedback decode(std::span<const std::byte> bytes, const std::string& name);

}  // namespace palpate::ros
