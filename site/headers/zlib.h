/* SPDX-License-Identifier: Apache-2.0 */
/* What is used of zlib where there is none: its checksum. */
#pragma once

#include <cstddef>
#include <cstdint>

using z_size_t = std::size_t;

inline unsigned long crc32_z(unsigned long before, const unsigned char* bytes, z_size_t size) {
  auto crc = ~static_cast<std::uint32_t>(before);
  for (z_size_t i = 0; i < size; ++i) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1U) ^ (0xedb88320U & (0U - (crc & 1U)));
  }
  return static_cast<std::uint32_t>(~crc);
}
