// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/io/bag/database.hpp"

namespace palpate {

/// The CRC-32 (IEEE 802.3) of a message: of its topic's name and type, its time and its bytes. It
/// notices every single flipped bit and every run of up to 32; it is no protection against someone
/// who changes a recording on purpose.
std::uint32_t checksum_of(std::string_view topic, std::string_view type, std::int64_t nanoseconds,
                          std::span<const std::byte> message);

/// The CRC-32 of bytes that come in several parts.
/// @param before  of the parts before, 0 for the first
std::uint32_t crc32_on(std::uint32_t before, std::span<const std::byte> bytes);

/// The checksums of the messages that one commit made final: a row of the table `checksum_table`
/// beside those of rosbag2, in palpate's recordings of before they were MCAP.
struct ChecksumBlock {
  std::int64_t first = 1;                 ///< id of the first message; the others follow it
  std::vector<std::uint32_t> messages{};  ///< of each message, in the order of their ids
  bool closed = false;                    ///< the bag was closed with this block
};
constexpr std::string_view checksum_table = "palpate_checksums";

/// Of a block and all before it: what the row keeps beside the block.
/// @param before  the value of the block before, 0 for the first one
std::uint32_t chained(std::uint32_t before, const ChecksumBlock& block);

/// The blocks of a database.
struct Checksums {
  bool there = false;  ///< false: the bag is not palpate's, or older than its checksums
  std::vector<ChecksumBlock> blocks{};
  std::string damage{};  ///< what is wrong with the block after these; empty if nothing is

  /// That of a message, or null if no block has it.
  [[nodiscard]] const std::uint32_t* find(std::int64_t id) const;
};
/// What is damaged is named in the result, not thrown.
Checksums read_checksums(const Database& database);

}  // namespace palpate
