// SPDX-License-Identifier: Apache-2.0
// Messages of a node beside what another's encoder makes of the same ones: Foxglove's
// rosmsg2-serialization, with ROS 2 Humble's definitions.
#include <cstddef>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/bag/node_messages.hpp"

namespace palpate::ros {
namespace test_node_messages {

std::string hex(const std::vector<std::byte>& bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    constexpr const char* digits = "0123456789abcdef";
    text += digits[std::to_integer<int>(byte) / 16];
    text += digits[std::to_integer<int>(byte) % 16];
  }
  return text;
}

const Header header{{17, 250'000'001}, "world"};

TEST(NodeMessages, AreWhatAnotherEncoderMakesOfDiagnostics) {
  DiagnosticArray report{header, {{}, {}}};
  report.status[0] = {1, "loop", "late", "", {{"rate", "980"}, {"n", ""}}};
  report.status[1] = {2, "x", "", "7", {}};
  EXPECT_EQ(
      hex(encode(report)),
      "000100001100000081b2e60e06000000776f726c640000000200000001000000050000006c6f6f7000000000"
      "050000006c617465000000000100000000000000020000000500000072617465000000000400000039383000"
      "020000006e000000010000000002000002000000780000000100000000000000020000003700000000000000");
}

TEST(NodeMessages, AreWhatAnotherEncoderMakesOfMarkers) {
  Marker line;
  line.header = header;
  line.ns = "hip";
  line.id = 3;
  line.kind = Marker::line_strip;
  line.position = {1.0, 2.0, 3.0};
  line.scale = {0.5, 0.0, 0.0};
  line.colour = {0.25F, 0.5F, 0.75F, 1.0F};
  line.lifetime = {1, 0};
  line.points = {{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}};
  EXPECT_EQ(
      hex(encode(MarkerArray{{line}})),
      "00010000010000001100000081b2e60e06000000776f726c6400000004000000686970000300000004000000"
      "0000000000000000000000000000f03f00000000000000400000000000000840000000000000000000000000"
      "000000000000000000000000000000000000f03f000000000000e03f00000000000000000000000000000000"
      "0000803e0000003f0000403f0000803f01000000000000000000000002000000000000000000f03f00000000"
      "0000004000000000000008400000000000001040000000000000144000000000000018400000000001000000"
      "0000000000000000000000000100000000000000010000000000000000000000000000000100000000000000"
      "010000000000000001000000000000000000000000");
}

TEST(NodeMessages, AreWhatAnotherEncoderMakesOfParameters) {
  const ParameterEvent event{
      header.stamp,
      "/palpate",
      {},
      {{"xi", ParameterValue::of(0.5)}, {"method", ParameterValue::of(std::string("paper"))}},
      {}};
  EXPECT_EQ(
      hex(encode(event)),
      "000100001100000081b2e60e090000002f70616c706174650000000000000000020000000300000078690003"
      "00000000000000000000000000000000000000000000e03f0100000000000000000000000000000000000000"
      "0000000000000000070000006d6574686f640004000000000000000000000000000000000000000000000000"
      "060000007061706572000000000000000000000000000000000000000000000000000000");
  ParameterDescriptor described;
  described.name = "xi";
  described.type = ParameterValue::number;
  described.description = "step";
  described.read_only = true;
  described.floating_point_range = {{0.0, 2.0, 0.0}};
  EXPECT_EQ(
      hex(encode(described)),
      "0001000003000000786900030500000073746570000000000100000000010000010000000000000000000000"
      "0000000000000040000000000000000000000000");
}

}  // namespace test_node_messages
}  // namespace palpate::ros
