// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "palpate/io/bag/cdr.hpp"
#include "palpate/kernel/core/hand.hpp"

// The messages of ROS 2's standard packages that a recording is made of; fields in the order and
// under the names of their definitions, units as ROS has them (REP 103). Each hands its fields, in
// that order, to whatever writes them, reads them, or lays them out in memory.
namespace palpate::ros {

/// The name of a type, as an argument of a template.
template <std::size_t size>
struct TypeName {
  char text[size];
  consteval TypeName(const char (&name)[size]) { std::copy_n(name, size, text); }
  [[nodiscard]] constexpr std::string_view view() const { return {text, size - 1}; }
};
template <std::size_t a, std::size_t b>
consteval TypeName<a + b - 1> operator+(const TypeName<a>& name, const TypeName<b>& suffix) {
  char text[a + b - 1]{};
  std::copy_n(suffix.text, b, std::copy_n(name.text, a - 1, text));
  return text;
}

/// A message of one field.
template <TypeName name, class Data>
struct Single {
  static constexpr std::string_view type = name.view();
  Data data{};

  static void walk(auto& way, auto& m) { way(m.data); }
};

/// builtin_interfaces/msg/Time. ROS counts from 1970 on the clock of the wall.
struct Time {
  std::int32_t sec = 0;       ///< [s]
  std::uint32_t nanosec = 0;  ///< [ns] below 10^9

  [[nodiscard]] std::int64_t nanoseconds() const {
    return std::int64_t{1'000'000'000} * sec + nanosec;
  }
  [[nodiscard]] double seconds() const { return 1e-9 * static_cast<double>(nanoseconds()); }
  /// Wrapped into what the fields can hold.
  static Time at(std::int64_t nanoseconds);
  /// By the wall clock of this machine.
  static Time now();

  static void walk(auto& way, auto& m) { way(m.sec, m.nanosec); }
};

struct Header {
  Time stamp;
  std::string frame_id;

  static void walk(auto& way, auto& m) {
    way.begin_header();
    way(m.stamp, m.frame_id);
  }
};

struct Image {
  static constexpr std::string_view type = "sensor_msgs/msg/Image";
  Header header;
  std::uint32_t height = 0, width = 0;  ///< [px]
  std::string encoding;                 ///< such as 16UC1 [mm], 32FC1 [m]
  std::uint8_t is_bigendian = 0;
  std::uint32_t step = 0;  ///< [bytes] of a row
  std::vector<std::byte> data;

  static void walk(auto& way, auto& m) {
    way(m.header, m.height, m.width, m.encoding, m.is_bigendian, m.step, m.data);
  }
};

struct CompressedImage {
  static constexpr std::string_view type = "sensor_msgs/msg/CompressedImage";
  Header header;
  std::string format;  ///< such as "16UC1; compressedDepth png"
  std::vector<std::byte> data;

  static void walk(auto& way, auto& m) { way(m.header, m.format, m.data); }
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

  static void walk(auto& way, auto& m) {
    way(m.header, m.height, m.width, m.distortion_model, m.d, m.k, m.r, m.p, m.binning_x,
        m.binning_y, m.roi, m.do_rectify);
  }
};

struct PointField {
  std::string name;
  std::uint32_t offset = 0;   ///< [bytes] in a point
  std::uint8_t datatype = 0;  ///< 7 float32, 8 float64
  std::uint32_t count = 1;

  static void walk(auto& way, auto& m) { way(m.name, m.offset, m.datatype, m.count); }
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

  static void walk(auto& way, auto& m) {
    way(m.header, m.height, m.width, m.fields, m.is_bigendian, m.point_step, m.row_step, m.data,
        m.is_dense);
  }
};

struct PoseStamped {
  static constexpr std::string_view type = "geometry_msgs/msg/PoseStamped";
  Header header;
  std::array<double, 3> position{};                       ///< [m]
  std::array<double, 4> orientation{0.0, 0.0, 0.0, 1.0};  ///< x y z w

  static void walk(auto& way, auto& m) { way(m.header, m.position, m.orientation); }
};

struct WrenchStamped {
  static constexpr std::string_view type = "geometry_msgs/msg/WrenchStamped";
  Header header;
  std::array<double, 3> force{}, torque{};  ///< [N], [N m]

  static void walk(auto& way, auto& m) { way(m.header, m.force, m.torque); }
};

/// What another clock says.
struct TimeReference {
  static constexpr std::string_view type = "sensor_msgs/msg/TimeReference";
  Header header;  ///< stamp: by the clock of the sender
  Time time_ref;  ///< by the other one
  std::string source;

  static void walk(auto& way, auto& m) { way(m.header, m.time_ref, m.source); }
};

struct Transform {
  static constexpr std::string_view type = "geometry_msgs/msg/Transform";
  std::array<double, 3> translation{};                 ///< [m]
  std::array<double, 4> rotation{0.0, 0.0, 0.0, 1.0};  ///< x y z w

  static void walk(auto& way, auto& m) { way(m.translation, m.rotation); }
};

struct TransformStamped {
  Header header;  ///< frame_id: the parent
  std::string child_frame_id;
  std::array<double, 3> translation{};                 ///< [m]
  std::array<double, 4> rotation{0.0, 0.0, 0.0, 1.0};  ///< x y z w

  static void walk(auto& way, auto& m) {
    way(m.header, m.child_frame_id, m.translation, m.rotation);
  }
};

struct TFMessage {
  static constexpr std::string_view type = "tf2_msgs/msg/TFMessage";
  std::vector<TransformStamped> transforms;

  static void walk(auto& way, auto& m) { way(m.transforms); }
};

/// One dimension, labelled.
struct Float64MultiArray {
  static constexpr std::string_view type = "std_msgs/msg/Float64MultiArray";
  std::string label;
  std::vector<double> data;

  struct Dimension {
    std::string label;
    std::uint32_t size = 0, stride = 0;

    static void walk(auto& way, auto& m) { way(m.label, m.size, m.stride); }
  };
  // ROS's layout of one dimension; further ones are passed over.
  static void walk(auto& way, auto& m) {
    const auto size = static_cast<std::uint32_t>(m.data.size());
    std::vector<Dimension> dimensions{{m.label, size, size}};
    std::uint32_t offset = 0;
    way(dimensions, offset, m.data);
    if constexpr (!std::is_const_v<std::remove_reference_t<decltype(m)>>)
      m.label = dimensions.empty() ? "" : dimensions.front().label;
  }
};

using Float32 = Single<"std_msgs/msg/Float32", float>;
using String = Single<"std_msgs/msg/String", std::string>;
using Bool = Single<"std_msgs/msg/Bool", bool>;
using UInt8 = Single<"std_msgs/msg/UInt8", std::uint8_t>;
using UInt32 = Single<"std_msgs/msg/UInt32", std::uint32_t>;

struct KeyValue {
  static constexpr std::string_view type = "diagnostic_msgs/msg/KeyValue";
  std::string key, value;

  static void walk(auto& way, auto& m) { way(m.key, m.value); }
};

using Point = Single<"geometry_msgs/msg/Point", std::array<double, 3>>;
using Vector3 = Single<"geometry_msgs/msg/Vector3", std::array<double, 3>>;

struct Wrench {
  static constexpr std::string_view type = "geometry_msgs/msg/Wrench";
  std::array<double, 3> force{}, torque{};  ///< [N], [N m]

  static void walk(auto& way, auto& m) { way(m.force, m.torque); }
};

/// Of the Touch drivers of the omni_common line.
struct OmniFeedback {
  static constexpr std::string_view type = "omni_msgs/msg/OmniFeedback";
  std::array<double, 3> force{}, position{};  ///< [N], of a lock that only old drivers have

  static void walk(auto& way, auto& m) { way(m.force, m.position); }
};

/// A message as it lies in a bag of ROS 2.
template <Walkable Message>
std::vector<std::byte> encode(const Message& message) {
  CdrWriter out;
  out(message);
  return out.take();
}

/// The same back.
/// @param name  of the message, for errors  @throws Error if it is damaged.
template <Walkable Message>
Message decode(std::span<const std::byte> bytes, const std::string& name,
               CdrReader::Layout layout = CdrReader::Layout::cdr) {
  CdrReader in(bytes, name, layout);
  Message message;
  in(message);
  return message;
}

/// A message of ROS 1, in CDR. Known are Image, CompressedImage, CameraInfo, PointCloud2,
/// Transform, TFMessage, Float32, KeyValue and String.
/// @param type  as ROS 2 names it  @param name  of the message, for errors
/// @throws Error if it is of another type, or damaged.
std::vector<std::byte> from_ros1(std::string_view type, std::span<const std::byte> bytes,
                                 const std::string& name);

/// The definition of a message that a recording is made of and of all that it consists of, as
/// schemas of MCAP have it ("ros2msg"): with it a reader needs no package of ROS's.
/// @param type  such as sensor_msgs/msg/CameraInfo  @return empty for a type that is not known
std::string definition_of(std::string_view type);

}  // namespace palpate::ros

namespace palpate {

/// As messages have a vector.
inline std::array<double, 3> components(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

inline ros::PoseStamped pose_of(ros::Header header, const Vec3& position, const Rotation& q) {
  return {std::move(header), components(position), {q.x(), q.y(), q.z(), q.w()}};
}

}  // namespace palpate
