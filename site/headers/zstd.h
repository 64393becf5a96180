/* SPDX-License-Identifier: Apache-2.0 */
/* In place of zstd's encoder: frames of blocks that are stored as they are. */
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

constexpr std::size_t zstd_block = std::size_t{1} << 17U;
constexpr std::size_t zstd_head = 9; /* magic, descriptor, four bytes of window or size */

inline std::size_t ZSTD_compressBound(std::size_t size) {
  return zstd_head + size + 3 * (size / zstd_block + 1);
}

inline std::size_t ZSTD_compress(void* to, std::size_t /*room*/, const void* from, std::size_t size,
                                 int /*level*/) {
  auto* out = static_cast<std::uint8_t*>(to);
  const auto* in = static_cast<const std::uint8_t*>(from);
  const auto put = [&out](std::size_t number, int bytes) {
    for (int i = 0; i < bytes; ++i) *out++ = static_cast<std::uint8_t>(number >> (8 * i));
  };
  put(0xfd2fb528U, 4);
  put(0xa0U, 1); /* one segment, whose size follows in four bytes */
  put(size, 4);
  for (std::size_t at = 0; at == 0 || at < size; at += zstd_block) {
    const std::size_t count = std::min(zstd_block, size - at);
    put(count << 3U | (at + count >= size ? 1U : 0U), 3); /* a raw block; the last one */
    std::memcpy(out, in + at, count);
    out += count;
  }
  return static_cast<std::size_t>(out - static_cast<std::uint8_t*>(to));
}
