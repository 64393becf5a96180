// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/io/sources/depth_png.hpp"

namespace palpate::test {

/// PNG's checksum (ISO 3309 CRC-32).
inline std::uint32_t crc_of(std::string_view bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const char byte : bytes) {
    crc ^= static_cast<std::uint8_t>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320u : 0u);
  }
  return ~crc;
}

inline std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
  return bytes;
}

inline std::string chunk(const std::string& type, const std::string& content) {
  return big_endian(static_cast<std::uint32_t>(content.size())) + type + content +
         big_endian(crc_of(type + content));
}

/// PNG's types of colour.
enum Colour : char { grey = 0, rgb = 2, palette = 3, grey_alpha = 4, rgba = 6 };

/// A PNG put together by hand, without a PNG library: the oracle for the reader. `samples` are the
/// image's bytes, the filter byte of each row included, stored in one uncompressed block.
inline std::string png_of(std::uint32_t width, std::uint32_t height, char bits, Colour colour,
                          const std::string& samples, char interlace = 0) {
  std::uint32_t a = 1;
  std::uint32_t b = 0;
  for (const char sample : samples) {
    a = (a + static_cast<std::uint8_t>(sample)) % 65521;
    b = (b + a) % 65521;
  }
  const auto size = static_cast<std::uint16_t>(samples.size());
  std::string deflated = "\x78\x01\x01";  // zlib, then one last stored block
  for (const int part : {size & 255, size >> 8, ~size & 255, ~size >> 8 & 255}) {
    deflated += static_cast<char>(part);
  }
  deflated += samples + big_endian(b << 16 | a);
  std::string header = big_endian(width) + big_endian(height);
  header += {bits, colour, 0, 0, interlace};
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) +
         (colour == palette ? chunk("PLTE", "abcdef") : "") + chunk("IDAT", deflated) +
         chunk("IEND", "");
}

/// Writes depth as the library packs it.
inline void write_depth_png(const std::filesystem::path& path, int width, int height,
                            std::span<const std::uint16_t> depth) {
  const std::vector<std::byte> bytes = encode_depth_png(width, height, depth);
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

}  // namespace palpate::test
