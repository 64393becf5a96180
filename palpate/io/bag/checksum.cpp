// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag/checksum.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include <zlib.h>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

std::uint32_t add(std::uint32_t crc, const void* bytes, std::size_t size) {
  if (size == 0) return crc;  // for which zlib would begin anew where there is no pointer
  return static_cast<std::uint32_t>(
      crc32_z(crc, static_cast<const unsigned char*>(bytes), static_cast<z_size_t>(size)));
}

std::uint32_t add(std::uint32_t crc, std::int64_t number) {
  static_assert(std::endian::native == std::endian::little, "numbers count as they lie in RAM");
  return add(crc, &number, sizeof number);
}

// With its length, so that no two pairs of texts count as the same bytes.
std::uint32_t add(std::uint32_t crc, std::string_view text) {
  crc = add(crc, static_cast<std::int64_t>(text.size()));
  return add(crc, text.data(), text.size());
}

std::span<const std::byte> bytes_of(const std::vector<std::uint32_t>& words) {
  return std::as_bytes(std::span(words));
}

bool has_table(const Database& database) {
  Statement look(database, "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = ?");
  look.bind(0, checksum_table);
  return look.step() && look.integer(0) == 1;
}

}  // namespace

std::uint32_t crc32_on(std::uint32_t before, std::span<const std::byte> bytes) {
  return add(before, bytes.data(), bytes.size());
}

std::uint32_t checksum_of(std::string_view topic, std::string_view type, std::int64_t nanoseconds,
                          std::span<const std::byte> message) {
  const std::uint32_t crc = add(add(add(0, topic), type), nanoseconds);
  return add(crc, message.data(), message.size());
}

std::uint32_t chained(std::uint32_t before, const ChecksumBlock& block) {
  const std::span<const std::byte> words = bytes_of(block.messages);
  const std::uint32_t crc = add(add(add(0, before), block.first), block.closed ? 1 : 0);
  return add(crc, words.data(), words.size());
}

const std::uint32_t* Checksums::find(std::int64_t id) const {
  auto block = std::upper_bound(
      blocks.begin(), blocks.end(), id,
      [](std::int64_t wanted, const ChecksumBlock& each) { return wanted < each.first; });
  if (block == blocks.begin()) return nullptr;
  --block;
  const auto index = static_cast<std::uint64_t>(id - block->first);
  return index < block->messages.size() ? &block->messages[index] : nullptr;
}

Checksums read_checksums(const Database& database) {
  Checksums checksums;
  std::size_t row = 0;
  try {
    checksums.there = has_table(database);
    if (!checksums.there) return checksums;
    std::uint32_t chain = 0;
    std::int64_t next = 1;
    Statement list(database, "SELECT first, closed, crc32, chain FROM " +
                                 std::string(checksum_table) + " ORDER BY id");
    for (; list.step(); ++row) {
      ChecksumBlock block{.first = list.integer(0), .closed = list.integer(1) != 0};
      const std::span<const std::byte> bytes = list.bytes(2);
      block.messages.resize(bytes.size() / sizeof(std::uint32_t));
      if (!block.messages.empty())
        std::memcpy(block.messages.data(), bytes.data(),
                    block.messages.size() * sizeof(std::uint32_t));
      chain = chained(chain, block);
      const bool is_whole = bytes.size() % sizeof(std::uint32_t) == 0 && block.first == next &&
                            list.integer(1) == std::int64_t{block.closed} &&
                            list.integer(3) == std::int64_t{chain};
      if (!is_whole) {
        checksums.damage = "block " + std::to_string(row + 1) + " of its checksums is damaged";
        return checksums;
      }
      next += static_cast<std::int64_t>(block.messages.size());
      checksums.blocks.push_back(std::move(block));
    }
  } catch (const Error& error) {
    checksums.damage = error.what();
  }
  return checksums;
}

}  // namespace palpate
