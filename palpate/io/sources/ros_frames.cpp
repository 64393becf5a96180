// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/ros_frames.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string_view>
#include <utility>

#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/depth_rvl.hpp"
#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr std::size_t config_header = 12;  // of compressedDepth: int32, 2 x float32
constexpr std::string_view slice_packing = "slice rvl";
constexpr std::string_view units_key = "units_per_metre=";
constexpr std::uint8_t uint32 = 6, float32 = 7, float64 = 8;  // PointField::datatype
constexpr double least_units = 1.0, most_units = 1e6;         // [1/m]

std::endian order_of(bool is_bigendian) {
  return is_bigendian ? std::endian::big : std::endian::little;
}

std::uint16_t quantised(double metres, double units) {
  const double raw = std::round(metres * units);
  return raw >= 1.0 && raw < 65535.0 ? static_cast<std::uint16_t>(raw) : std::uint16_t{0};
}

// Where in a point x, y or z is, and of which type.
struct AxisField {
  std::size_t offset = 0;  // [bytes]
  const detail::Scalar* type = nullptr;
};

std::array<AxisField, 3> axis_fields_of(const ros::PointCloud2& message, const std::string& name) {
  std::array<AxisField, 3> axes;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string wanted(1, "xyz"[axis]);
    const auto field = std::find_if(message.fields.begin(), message.fields.end(),
                                    [&](const auto& f) { return f.name == wanted; });
    if (field == message.fields.end() || (field->datatype != float32 && field->datatype != float64))
      throw Error(name, "has no field " + wanted + " of float32 or float64",
                  "name another topic with ?topic=");
    const std::string_view type = field->datatype == float64 ? "float64" : "float32";
    axes[axis] = {field->offset,
                  detail::find_scalar([&](const auto& s) { return s.name == type; })};
    if (axes[axis].offset + axes[axis].type->size > message.point_step)
      throw Error(name, "has fields beyond the end of a point", "it may be damaged");
  }
  return axes;
}

// Metres as floats.
bool is_float(const std::string& encoding) { return encoding == "32FC1"; }

// "16UC1; PACKING", and the unit where it is not ROS's.
std::string format_of(std::string_view packing, double units_per_metre) {
  std::string format = "16UC1; ";
  format += packing;
  if (units_per_metre == units_of_16uc1) return format;
  std::array<char, 32> digits{};
  format += "; ";
  format += units_key;
  const auto end = std::to_chars(digits.begin(), digits.end(), units_per_metre).ptr;
  return format.append(digits.data(), end);
}

// @param size  [bytes] of a pixel
void check_size(const ros::Image& image, std::size_t size, const std::string& name) {
  if (image.width == 0 || image.height == 0 || image.width > largest_side ||
      image.height > largest_side || image.step < image.width * size ||
      image.data.size() / image.height < image.step)
    throw Error(name,
                "is an image of " + size_text(image.width, image.height) + " pixels in " +
                    std::to_string(image.data.size()) + " bytes, which do not fit",
                "it may be damaged");
}

std::vector<std::uint16_t> raw_depth(const ros::Image& image, double units,
                                     const std::string& name) {
  const bool floats = is_float(image.encoding);
  if (!floats && image.encoding != "16UC1" && image.encoding != "mono16")
    throw Error(name, "is an image of encoding '" + image.encoding + "', not of depth",
                "name a topic of 16UC1 or 32FC1 with ?topic=");
  const std::size_t size = floats ? 4 : 2;
  check_size(image, size, name);
  const std::endian order = order_of(image.is_bigendian != 0);
  std::vector<std::uint16_t> depth(std::size_t{image.width} * image.height);
  for (std::size_t v = 0, i = 0; v < image.height; ++v) {
    for (std::size_t u = 0; u < image.width; ++u, ++i) {
      const std::byte* const at = &image.data[v * image.step + u * size];
      depth[i] = floats ? quantised(detail::load<float>(at, order), units)
                        : detail::load<std::uint16_t>(at, order);
    }
  }
  return depth;
}

ros::Image unpacked(ros::CompressedImage message, double units, const std::string& name) {
  if (message.format.find("compressedDepth") == std::string::npos)
    throw Error(name, "is an image of format '" + message.format + "', not of depth",
                "name a topic of depth with ?topic=");
  if (message.data.size() < config_header) throw Error(name, "is empty", "it may be damaged");
  const auto packed = std::span(std::as_const(message.data)).subspan(config_header);
  const bool is_rvl = message.format.find("compressedDepth rvl") != std::string::npos;
  DepthPng raw = is_rvl ? parse_depth_rvl(packed, name) : parse_depth_png(packed, name);
  ros::Image image{.header = std::move(message.header),
                   .height = static_cast<std::uint32_t>(raw.height),
                   .width = static_cast<std::uint32_t>(raw.width),
                   .encoding = message.format.substr(0, message.format.find(';')),
                   .is_bigendian = std::endian::native == std::endian::big,
                   .step = static_cast<std::uint32_t>(2 * raw.width),
                   .data = {}};
  if (is_float(image.encoding)) {
    image.encoding = "16UC1";
    const double a = detail::load<float>(&message.data[4], std::endian::native);
    const double b = detail::load<float>(&message.data[8], std::endian::native);
    for (std::uint16_t& d : raw.depth) d = d == 0 ? d : quantised(a / (d - b), units);
  }
  const auto bytes = std::as_bytes(std::span(raw.depth));
  image.data.assign(bytes.begin(), bytes.end());
  return image;
}

// Fills points, row by row, and their colours where the message has `rgb` or `rgba`.
void read_points(const ros::PointCloud2& message, const std::string& name, RosFrame& frame) {
  std::vector<Vec3>& points = frame.points.emplace();
  if (message.width == 0 || message.height == 0) return;
  const auto axes = axis_fields_of(message, name);
  const std::size_t row = std::size_t{message.width} * message.point_step;
  if (message.height > 1 && message.row_step < row)
    throw Error(name, "has rows that overlap", "it may be damaged");
  const std::size_t row_step = message.height > 1 ? message.row_step : row;
  if (row > message.data.size() || message.height - 1 > (message.data.size() - row) / row_step)
    throw Error(name, "declares more points than it contains", "it may be damaged");
  const std::endian order = order_of(message.is_bigendian);
  const auto colour =
      std::find_if(message.fields.begin(), message.fields.end(), [&](const auto& f) {
        return (f.name == "rgb" || f.name == "rgba") &&
               (f.datatype == uint32 || f.datatype == float32) &&
               f.offset + std::size_t{4} <= message.point_step;
      });
  points.reserve(std::size_t{message.width} * message.height);
  for (std::size_t v = 0; v < message.height; ++v) {
    for (std::size_t u = 0; u < message.width; ++u) {
      const std::byte* const at = &message.data[v * row_step + u * message.point_step];
      Vec3& point = points.emplace_back();
      for (std::size_t axis = 0; axis < 3; ++axis)
        point[static_cast<Eigen::Index>(axis)] =
            axes[axis].type->value(at + axes[axis].offset, order);
      if (colour == message.fields.end()) continue;
      const auto packed = detail::load<std::uint32_t>(at + colour->offset, order);
      for (const unsigned shift : {16U, 8U, 0U})
        frame.rgb.push_back(static_cast<std::uint8_t>(packed >> shift));
    }
  }
}

std::string above(const std::string& topic) { return topic.substr(0, topic.rfind('/')); }

}  // namespace

bool is_topic_of_depth(const std::string& topic, const std::string& type) {
  if (type == ros::Image::type)
    return topic.find("depth") != std::string::npos || topic.find("/Depth_") != std::string::npos;
  return (type == ros::CompressedImage::type &&
          (topic.ends_with("/compressedDepth") || topic.ends_with("/slices"))) ||
         type == ros::PointCloud2::type;
}

std::string camera_of_topic(const std::string& topic, const std::string& type) {
  const bool is_deep = type == ros::CompressedImage::type || topic.ends_with("/image/data");
  return above(is_deep ? above(topic) : topic);
}

double depth_units(const std::string& format, const std::string& name) {
  const std::size_t at = format.find(units_key);
  if (at == std::string::npos)
    return is_float(format.substr(0, format.find(';'))) ? units_of_32fc1 : units_of_16uc1;
  const char* begin = format.data() + at + units_key.size();
  double units = 0.0;
  const auto [end, error] = std::from_chars(begin, format.data() + format.size(), units);
  if (error != std::errc() || !(units >= least_units && units <= most_units) ||
      (end != format.data() + format.size() && *end != ';'))
    throw Error(name, "says '" + format.substr(at) + "' for its unit of depth",
                "give the raw values per metre, such as ?units=1000");
  return units;
}

std::vector<std::uint8_t> rgb_of(const ros::Image& image, const std::string& name) {
  const std::string& encoding = image.encoding;
  const bool is_rgb = encoding == "rgb8" || encoding == "rgba8";
  if (!is_rgb && encoding != "bgr8" && encoding != "bgra8")
    throw Error(name, "is an image of encoding '" + encoding + "', not of colour",
                "record rgb8 or bgr8");
  const std::size_t size = encoding.size() - 1;  // [bytes] of a pixel: one for each letter
  check_size(image, size, name);
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * std::size_t{image.width} * image.height);
  for (std::size_t v = 0; v < image.height; ++v) {
    for (std::size_t u = 0; u < image.width; ++u) {
      const std::size_t at = v * image.step + u * size;
      for (std::size_t channel : {0U, 1U, 2U})
        rgb.push_back(static_cast<std::uint8_t>(image.data[at + (is_rgb ? channel : 2 - channel)]));
    }
  }
  return rgb;
}

Intrinsics intrinsics_of(const ros::CameraInfo& info, bool is_rectified, const std::string& name) {
  Intrinsics k{.width = static_cast<int>(std::min(info.width, largest_side + 1)),
               .height = static_cast<int>(std::min(info.height, largest_side + 1)),
               .fx = info.k[0],
               .fy = info.k[4],
               .cx = info.k[2],
               .cy = info.k[5]};
  if (is_rectified && info.p[0] > 0.0) {
    k.fx = info.p[0];
    k.fy = info.p[5];
    k.cx = info.p[2];
    k.cy = info.p[6];
    return k;
  }
  const bool any = std::any_of(info.d.begin(), info.d.end(), [](double d) { return d != 0.0; });
  if (!any) return k;
  const bool is_known =
      info.distortion_model == "plumb_bob" || info.distortion_model == "rational_polynomial";
  if (!is_known || info.d.size() > k.distortion.size())
    throw Error(name, "has the distortion model '" + info.distortion_model + "'",
                "rectify the images; plumb_bob and rational_polynomial can be read");
  std::copy(info.d.begin(), info.d.end(), k.distortion.begin());
  return k;
}

ros::CameraInfo camera_info_of(const ros::Header& header, const Intrinsics& k) {
  ros::CameraInfo info{.header = header,
                       .height = static_cast<std::uint32_t>(k.height),
                       .width = static_cast<std::uint32_t>(k.width),
                       .distortion_model = k.distorted() ? "rational_polynomial" : "plumb_bob",
                       .d = std::vector<double>(k.distorted() ? 8 : 5),
                       .k = {k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0},
                       .r = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0},
                       .p = {k.fx, 0.0, k.cx, 0.0, 0.0, k.fy, k.cy, 0.0, 0.0, 0.0, 1.0, 0.0}};
  if (k.distorted()) std::copy(k.distortion.begin(), k.distortion.end(), info.d.begin());
  return info;
}

ros::CompressedImage compressed_depth(const ros::Header& header, std::span<const std::byte> packed,
                                      double units_per_metre, DepthPacking packing) {
  ros::CompressedImage message{
      .header = header,
      .format =
          format_of(packing == DepthPacking::rvl ? "compressedDepth rvl" : "compressedDepth png",
                    units_per_metre),
      .data = {}};
  // The transport's own header, which is of no meaning to whole numbers, comes first.
  message.data.resize(config_header);
  message.data.insert(message.data.end(), packed.begin(), packed.end());
  return message;
}

ros::CompressedImage depth_slice(const ros::Header& header, std::span<const std::byte> slice,
                                 double units_per_metre) {
  return {.header = header,
          .format = format_of(slice_packing, units_per_metre),
          .data = {slice.begin(), slice.end()}};
}

bool is_depth_slice(const ros::CompressedImage& message) {
  return message.format.find(slice_packing) != std::string::npos;
}

std::shared_ptr<ColourImage> RosFrame::colour() const {
  if (rgb.empty()) return nullptr;
  return std::make_shared<ColourImage>(
      ColourImage{static_cast<int>(width), static_cast<int>(height), rgb});
}

RosFrame ros_frame_of(std::string_view type, std::span<const std::byte> cdr,
                      const std::optional<double>& units, const std::string& name) {
  RosFrame frame;
  if (type == ros::PointCloud2::type) {
    auto cloud = ros::decode<ros::PointCloud2>(cdr, name);
    frame.details = "PointCloud2";
    frame.width = cloud.width;
    frame.height = cloud.height;
    read_points(cloud, name, frame);
    frame.header = std::move(cloud.header);
    return frame;
  }
  ros::Image image;
  if (type == ros::Image::type) {
    image = ros::decode<ros::Image>(cdr, name);
    frame.details = image.encoding;
    frame.units = units ? *units : depth_units(frame.details, name);
  } else {
    auto packed = ros::decode<ros::CompressedImage>(cdr, name);
    frame.details = packed.format;
    frame.units = units ? *units : depth_units(frame.details, name);
    image = unpacked(std::move(packed), frame.units, name);
  }
  frame.width = image.width;
  frame.height = image.height;
  frame.depth = raw_depth(image, frame.units, name);
  frame.header = std::move(image.header);
  return frame;
}

std::shared_ptr<const Cloud> cloud_of(RosFrame frame, std::shared_ptr<const ViewingRays> rays,
                                      const Eigen::Isometry3d& pose, OrganisedClouds& organised) {
  if (!frame.points)
    return std::make_shared<DepthImage>(std::move(rays), std::move(frame.depth), frame.units, pose);
  std::vector<Vec3>& points = *frame.points;
  if (auto image = organised.image(points, frame.width, frame.height, std::nullopt, pose))
    return image;
  for (Vec3& point : points) point = pose * point;
  if (frame.rgb.empty()) return std::make_shared<PointCloud>(points);
  return std::make_shared<PointCloud>(Surface{.points = std::move(points)});
}

}  // namespace palpate
