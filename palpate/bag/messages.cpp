// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/messages.hpp"

#include "palpate/bag/cdr_ways.hpp"
#include "palpate/bag/message_walks.hpp"
#include "palpate/core/error.hpp"

namespace palpate::ros {
namespace {

template <class Message, class Walk>
std::vector<std::byte> in_cdr(std::span<const std::byte> bytes, const std::string& name,
                              const Walk& walk) {
  Get get(bytes, name, CdrReader::Layout::ros1);
  Message message;
  walk(get, message);
  return encode_by(message, walk);
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

std::vector<std::byte> encode(const Image& message) {
  return encode_by(message, image);
}
std::vector<std::byte> encode(const CompressedImage& message) {
  return encode_by(message, compressed);
}
std::vector<std::byte> encode(const CameraInfo& message) {
  return encode_by(message, camera);
}
std::vector<std::byte> encode(const PointCloud2& message) {
  return encode_by(message, points);
}
std::vector<std::byte> encode(const PoseStamped& message) {
  return encode_by(message, pose);
}
std::vector<std::byte> encode(const WrenchStamped& message) {
  return encode_by(message, wrench);
}
std::vector<std::byte> encode(const TimeReference& message) {
  return encode_by(message, time_reference);
}
std::vector<std::byte> encode(const Transform& message) {
  return encode_by(message, transform);
}
std::vector<std::byte> encode(const TFMessage& message) {
  return encode_by(message, transforms);
}
std::vector<std::byte> encode(const Float32& message) {
  return encode_by(message, float32);
}
std::vector<std::byte> encode(const KeyValue& message) {
  return encode_by(message, key_value);
}
std::vector<std::byte> encode(const String& message) {
  return encode_by(message, string);
}

std::vector<std::byte> encode(const Float64MultiArray& message) {
  return encode_by(message, multi_array);
}
std::vector<std::byte> encode(const Bool& message) {
  return encode_by(message, boolean);
}
std::vector<std::byte> encode(const Point& message) {
  return encode_by(message, point);
}
std::vector<std::byte> encode(const Vector3& message) {
  return encode_by(message, point);
}
std::vector<std::byte> encode(const Wrench& message) {
  return encode_by(message, plain_wrench);
}
std::vector<std::byte> encode(const OmniFeedback& message) {
  return encode_by(message, omni_feedback);
}

std::vector<std::byte> from_ros1(std::string_view type, std::span<const std::byte> bytes,
                                 const std::string& name) {
  if (type == Image::type) return in_cdr<Image>(bytes, name, image);
  if (type == CompressedImage::type) return in_cdr<CompressedImage>(bytes, name, compressed);
  if (type == CameraInfo::type) return in_cdr<CameraInfo>(bytes, name, camera);
  if (type == PointCloud2::type) return in_cdr<PointCloud2>(bytes, name, points);
  if (type == Transform::type) return in_cdr<Transform>(bytes, name, transform);
  if (type == TFMessage::type) return in_cdr<TFMessage>(bytes, name, transforms);
  if (type == Float32::type) return in_cdr<Float32>(bytes, name, float32);
  if (type == KeyValue::type) return in_cdr<KeyValue>(bytes, name, key_value);
  if (type == String::type) return in_cdr<String>(bytes, name, string);
  throw Error(name, "is of " + std::string(type) + ", which is not read from bags of ROS 1",
              "name another topic");
}

template <>
Image decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<Image>(bytes, name, image);
}
template <>
CompressedImage decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<CompressedImage>(bytes, name, compressed);
}
template <>
CameraInfo decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<CameraInfo>(bytes, name, camera);
}
template <>
PointCloud2 decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<PointCloud2>(bytes, name, points);
}
template <>
PoseStamped decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<PoseStamped>(bytes, name, pose);
}
template <>
WrenchStamped decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<WrenchStamped>(bytes, name, wrench);
}
template <>
TimeReference decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<TimeReference>(bytes, name, time_reference);
}
template <>
Transform decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<Transform>(bytes, name, transform);
}
template <>
TFMessage decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<TFMessage>(bytes, name, transforms);
}
template <>
Float32 decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<Float32>(bytes, name, float32);
}
template <>
KeyValue decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<KeyValue>(bytes, name, key_value);
}
template <>
String decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<String>(bytes, name, string);
}

template <>
Float64MultiArray decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<Float64MultiArray>(bytes, name, multi_array);
}
template <>
Bool decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<Bool>(bytes, name, boolean);
}
template <>
Point decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<Point>(bytes, name, point);
}
template <>
Vector3 decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<Vector3>(bytes, name, point);
}
template <>
Wrench decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<Wrench>(bytes, name, plain_wrench);
}
template <>
OmniFeedback decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<OmniFeedback>(bytes, name, omni_feedback);
}

}  // namespace palpate::ros
