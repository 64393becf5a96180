// SPDX-License-Identifier: Apache-2.0
// What reader and writer of MCAP share; the format is described at https://mcap.dev/spec.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include <zlib.h>

namespace palpate {

constexpr std::string_view mcap_magic = "\x89MCAP0\r\n";  // at both ends of a file
constexpr std::size_t record_head = 9;                    // [bytes] kind and length
constexpr std::size_t message_head = 22;                  // [bytes] channel, sequence, two times

enum class RecordKind : std::uint8_t {
  none = 0,
  header = 1,
  footer = 2,
  schema = 3,
  channel = 4,
  message = 5,
  chunk = 6,
  message_index = 7,
  chunk_index = 8,
  attachment = 9,
  statistics = 11,
  data_end = 15,
};

/// The CRC-32 (IEEE 802.3) of bytes that come in several parts: it notices every single flipped bit
/// and every run of up to 32.
/// @param before  of the parts before, 0 for the first
inline std::uint32_t crc32_on(std::uint32_t before, std::span<const std::byte> bytes) {
  if (bytes.empty()) return before;  // for which zlib would begin anew where there is no pointer
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

}  // namespace palpate
