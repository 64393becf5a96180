// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag/messages.hpp"

#include <chrono>

#include "palpate/kernel/core/error.hpp"

namespace palpate::ros {
namespace {

template <class... Known>
std::vector<std::byte> in_cdr(std::string_view type, std::span<const std::byte> bytes,
                              const std::string& name) {
  std::vector<std::byte> cdr;
  const auto encoded_as = [&]<class Message>(const Message*) {
    if (type != Message::type) return false;
    cdr = encode(decode<Message>(bytes, name, CdrReader::Layout::ros1));
    return true;
  };
  if (!(encoded_as(static_cast<const Known*>(nullptr)) || ...))
    throw Error(name, "is of " + std::string(type) + ", which is not read from bags of ROS 1",
                "name another topic");
  return cdr;
}

// Types without "msg/", and their fields, as ROS 2's packages define them.
constexpr std::array<std::pair<std::string_view, std::string_view>, 21> definitions{{
    {"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"},
    {"std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"},
    {"std_msgs/String", "string data\n"},
    {"std_msgs/Float64MultiArray", "std_msgs/MultiArrayLayout layout\nfloat64[] data\n"},
    {"std_msgs/MultiArrayLayout", "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n"},
    {"std_msgs/MultiArrayDimension", "string label\nuint32 size\nuint32 stride\n"},
    {"sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"},
    {"sensor_msgs/CameraInfo",
     "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n"
     "float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n"
     "sensor_msgs/RegionOfInterest roi\n"},
    {"sensor_msgs/RegionOfInterest",
     "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"},
    {"sensor_msgs/PointCloud2",
     "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
     "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n"},
    {"sensor_msgs/PointField", "string name\nuint32 offset\nuint8 datatype\nuint32 count\n"},
    {"geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"},
    {"geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"},
    {"geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"},
    {"geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"},
    {"geometry_msgs/WrenchStamped", "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n"},
    {"geometry_msgs/Wrench", "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n"},
    {"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"},
    {"tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"},
    {"geometry_msgs/TransformStamped",
     "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
    {"geometry_msgs/Transform",
     "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
}};

std::string_view fields_of(std::string_view type) {
  const auto* const found = std::find_if(definitions.begin(), definitions.end(),
                                         [&](const auto& each) { return each.first == type; });
  return found == definitions.end() ? std::string_view() : found->second;
}

}  // namespace

Time Time::at(std::int64_t nanoseconds) {
  constexpr std::int64_t second = 1'000'000'000;
  std::int64_t sec = nanoseconds / second;
  std::int64_t rest = nanoseconds % second;
  if (rest < 0) {
    rest += second;
    --sec;
  }
  return {static_cast<std::int32_t>(sec), static_cast<std::uint32_t>(rest)};
}

Time Time::now() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  return at(std::chrono::duration_cast<std::chrono::nanoseconds>(since_1970).count());
}

std::vector<std::byte> from_ros1(std::string_view type, std::span<const std::byte> bytes,
                                 const std::string& name) {
  return in_cdr<Image, CompressedImage, CameraInfo, PointCloud2, Transform, TFMessage, Float32,
                KeyValue, String>(type, bytes, name);
}

std::string definition_of(std::string_view type) {
  std::string name(type);
  if (const std::size_t at = name.find("/msg/"); at != std::string::npos) name.erase(at, 4);
  std::string text;
  std::vector<std::string_view> types{name};
  for (std::size_t i = 0; i < types.size(); ++i) {
    const std::string_view fields = fields_of(types[i]);
    if (i > 0) text += std::string(80, '=') + "\nMSG: " + std::string(types[i]) + "\n";
    text += fields;
    // What its fields consist of: a type with a package's name before it.
    for (std::size_t line = 0; line < fields.size(); line = fields.find('\n', line) + 1) {
      const std::string_view part = fields.substr(line, fields.find_first_of(" [", line) - line);
      if (part.find('/') != std::string_view::npos &&
          std::find(types.begin(), types.end(), part) == types.end())
        types.push_back(part);
    }
  }
  return text;
}

}  // namespace palpate::ros
