// SPDX-License-Identifier: Apache-2.0
#pragma once

// RVL, the run-length code for depth images: A. Wilson, "Fast lossless depth image compression",
// ISS 2017. Runs of zeros and of values take turns; of values the differences to the one before are
// kept. All numbers are of a variable length, three bits and a flag at a time. As in
// compressed_depth_image_transport, width and height come first.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "palpate/sources/depth_png.hpp"

namespace palpate {

/// Packs a depth image without loss: some ten times as fast as a PNG, and larger by a fifth.
/// @param depth  row by row, width*height raw values
/// @throws Error if the sizes do not match.
std::vector<std::byte> encode_depth_rvl(int width, int height,
                                        std::span<const std::uint16_t> depth);

/// @param name  of the message, for errors
/// @throws Error if it is cut short, or holds more or other pixels than it promises.
DepthPng parse_depth_rvl(std::span<const std::byte> bytes, const std::string& name);

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
