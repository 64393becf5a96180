// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// The number of `size` bytes, at most 4, at a place of `bytes`, which must be so long.
inline std::uint32_t little_endian(std::span<const std::byte> bytes, std::size_t at,
                                   std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i)
    value |= std::to_integer<std::uint32_t>(bytes[at + i]) << (8 * i);
  return value;
}

/// The lowest `size` bytes of a number, at most 4.
inline void put_little_endian(std::vector<std::byte>& to, std::uint32_t value, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i)
    to.push_back(static_cast<std::byte>(value >> (8 * i) & 0xffU));
}

}  // namespace palpate
