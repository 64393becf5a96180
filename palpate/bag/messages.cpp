// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/messages.hpp"

#include "palpate/core/error.hpp"

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

std::vector<std::byte> from_ros1(std::string_view type, std::span<const std::byte> bytes,
                                 const std::string& name) {
  return in_cdr<Image, CompressedImage, CameraInfo, PointCloud2, Transform, TFMessage, Float32,
                KeyValue, String>(type, bytes, name);
}

}  // namespace palpate::ros
