// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/messages.hpp"

#include "palpate/bag/cdr.hpp"
#include "palpate/bag/message_walks.hpp"
#include "palpate/core/error.hpp"

namespace palpate::ros {
namespace {

// One walk over a message's fields serves both ways: `Fields` writes them, or reads them.
class Put {
 public:
  void begin_header() {}
  template <class T>
  void number(const T& value) {
    out_.put(value);
  }
  void flag(const bool& value) { out_.put(static_cast<std::uint8_t>(value ? 1 : 0)); }
  void text(const std::string& value) { out_.put_string(value); }
  void bytes(const std::vector<std::byte>& value) {
    out_.put_sequence(std::span(reinterpret_cast<const std::uint8_t*>(value.data()), value.size()));
  }
  template <class T>
  void numbers(const std::vector<T>& values) {
    out_.put_sequence(std::span(values));
  }
  template <class T, std::size_t n>
  void array(const std::array<T, n>& values) {
    out_.put_array(std::span<const T>(values));
  }
  template <class T, class Each>
  void sequence(const std::vector<T>& values, std::size_t /*least*/, const Each& each) {
    out_.put(static_cast<std::uint32_t>(values.size()));
    for (const T& value : values) each(value);
  }
  std::vector<std::byte> take() { return out_.take(); }

 private:
  CdrWriter out_;
};

class Get {
 public:
  Get(std::span<const std::byte> bytes, const std::string& name,
      CdrReader::Layout layout = CdrReader::Layout::cdr)
      : in_(bytes, name, layout) {}

  // A header of ROS 1 begins with a number that ROS 2 has no more.
  void begin_header() {
    if (in_.layout() == CdrReader::Layout::ros1) static_cast<void>(in_.get<std::uint32_t>());
  }

  template <class T>
  void number(T& value) {
    value = in_.get<T>();
  }
  void flag(bool& value) { value = in_.get<std::uint8_t>() != 0; }
  void text(std::string& value) { value = in_.get_string(); }
  void bytes(std::vector<std::byte>& value) {
    const std::span<const std::byte> bytes = in_.get_bytes();
    value.assign(bytes.begin(), bytes.end());
  }
  template <class T>
  void numbers(std::vector<T>& values) {
    values = in_.get_sequence<T>();
  }
  template <class T, std::size_t n>
  void array(std::array<T, n>& values) {
    for (T& value : values) value = in_.get<T>();
  }
  template <class T, class Each>
  void sequence(std::vector<T>& values, std::size_t least, const Each& each) {
    values.resize(in_.get_count(least));
    for (T& value : values) each(value);
  }

 private:
  CdrReader in_;
};

template <class Message, class Walk>
std::vector<std::byte> encode_by(const Message& message, const Walk& walk) {
  Put put;
  walk(put, message);
  return put.take();
}

template <class Message, class Walk>
Message decode_by(std::span<const std::byte> bytes, const std::string& name, const Walk& walk) {
  Get get(bytes, name);
  Message message;
  walk(get, message);
  return message;
}

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
