// SPDX-License-Identifier: Apache-2.0
// What reader and writer of MCAP share; the format is described at https://mcap.dev/spec.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

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

}  // namespace palpate
