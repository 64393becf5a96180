// SPDX-License-Identifier: Apache-2.0
#include <span>
#include <vector>

#include "palpate/io/bag/messages.hpp"
#include "palpate/io/bag/node_messages.hpp"

#include "tests/fuzz/expect.hpp"

namespace {

// What can be decoded must come out the same when it is encoded and decoded again.
template <class Message>
void check(std::span<const std::byte> bytes) {
  namespace ros = palpate::ros;
  palpate::test::succeeds([&] {
    const auto once = ros::encode(ros::decode<Message>(bytes, "fuzz"));
    palpate::test::expect(ros::encode(ros::decode<Message>(once, "again")) == once);
  });
}

}  // namespace

// The first byte chooses the type, the rest is the message in CDR.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace ros = palpate::ros;
  if (size == 0) return 0;
  const std::span<const std::byte> bytes = std::as_bytes(std::span(data, size)).subspan(1);
  switch (data[0] % 14) {
    case 0:
      check<ros::Image>(bytes);
      break;
    case 1:
      check<ros::CompressedImage>(bytes);
      break;
    case 2:
      check<ros::CameraInfo>(bytes);
      break;
    case 3:
      check<ros::PointCloud2>(bytes);
      break;
    case 4:
      check<ros::PoseStamped>(bytes);
      break;
    case 5:
      check<ros::WrenchStamped>(bytes);
      break;
    case 6:
      check<ros::TFMessage>(bytes);
      break;
    case 7:
      check<ros::Float64MultiArray>(bytes);
      break;
    case 8:
      check<ros::TimeReference>(bytes);
      break;
    case 10:
      check<ros::SetParameters::Request>(bytes);
      break;
    case 11:
      check<ros::GetParameters::Request>(bytes);
      break;
    case 12:
      check<ros::ListParameters::Request>(bytes);
      break;
    case 13:
      check<ros::Trigger::Request>(bytes);
      break;
    default:
      check<ros::String>(bytes);
  }
  return 0;
}
