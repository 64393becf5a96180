/* SPDX-License-Identifier: Apache-2.0 */
/* What is used of zlib where there is none: its checksum, and gzip, unpacked by the page. */
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "site/page.hpp"

using Bytef = unsigned char;
using uInt = unsigned;
constexpr int Z_OK = 0, Z_DATA_ERROR = -3, Z_SYNC_FLUSH = 2;

struct z_stream {
  Bytef* next_in;
  uInt avail_in;
  Bytef* next_out;
  uInt avail_out;
  std::vector<std::byte> all;
  std::size_t taken;
};

/* All of it at once, which must lie in `next_in`. */
inline int inflateInit2(z_stream* stream, int /*gzip*/) {
  stream->all = palpate::site::unpack_gzip(
      {reinterpret_cast<const std::byte*>(stream->next_in), stream->avail_in});
  return Z_OK;
}

inline int inflate(z_stream* stream, int /*flush*/) {
  const std::size_t size =
      std::min<std::size_t>(stream->avail_out, stream->all.size() - stream->taken);
  std::copy_n(stream->all.begin() + static_cast<std::ptrdiff_t>(stream->taken), size,
              reinterpret_cast<std::byte*>(stream->next_out));
  stream->taken += size;
  stream->avail_out -= static_cast<uInt>(size);
  return stream->all.empty() ? Z_DATA_ERROR : Z_OK;
}

inline int inflateEnd(z_stream* /*stream*/) {
  return Z_OK;
}

using z_size_t = std::size_t;

inline unsigned long crc32_z(unsigned long before, const unsigned char* bytes, z_size_t size) {
  auto crc = ~static_cast<std::uint32_t>(before);
  for (z_size_t i = 0; i < size; ++i) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1U) ^ (0xedb88320U & (0U - (crc & 1U)));
  }
  return static_cast<std::uint32_t>(~crc);
}
