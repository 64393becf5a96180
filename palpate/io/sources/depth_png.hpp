// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace palpate {

/// A depth image as it is stored in a file.
struct DepthPng {
  int width = 0;                     ///< [px]
  int height = 0;                    ///< [px]
  std::vector<std::uint16_t> depth;  ///< row by row, width*height raw values
};

/// Decodes a 16-bit grey PNG, interlaced or not; about 3 ms for 640x480.
/// @param name  of the file, for messages
/// @throws Error if it is no PNG, another kind of PNG, larger than 16384x16384, cut short or
///         corrupt. Its length is checked against the size in its header before allocating.
DepthPng parse_depth_png(std::span<const std::byte> bytes, const std::string& name);

/// @throws Error as parse_depth_png, or if the file cannot be read.
DepthPng read_depth_png(const std::filesystem::path& path);

/// An image in visible light, in grey.
struct GreyPng {
  int width = 0;                         ///< [px]
  int height = 0;                        ///< [px]
  std::vector<std::uint8_t> brightness;  ///< row by row, width*height; 255 is white
};

/// Decodes any PNG to 8-bit grey: colours are weighted by luminance, a transparent pixel is
/// taken as if it were opaque.
/// @throws Error as read_depth_png, but for its kind.
GreyPng read_grey_png(const std::filesystem::path& path);

/// An image in visible light, in colour.
struct ColourPng {
  int width = 0;                  ///< [px]
  int height = 0;                 ///< [px]
  std::vector<std::uint8_t> rgb;  ///< row by row, 3*width*height: red, green, blue of each pixel
};

/// Decodes any PNG to 8 bits each of red, green and blue; a transparent pixel as if it were opaque.
/// @throws Error as read_depth_png, but for its kind.
ColourPng read_colour_png(const std::filesystem::path& path);

/// A 16-bit grey PNG in memory, packed for speed rather than size: some 6 ms for 640x480. Any
/// thread.
/// @param depth  row by row, width*height raw values
/// @throws Error if the sizes do not match.
std::vector<std::byte> encode_depth_png(int width, int height,
                                        std::span<const std::uint16_t> depth);

/// Writes a 16-bit grey PNG, packed for speed rather than size.
/// @param depth  row by row, width*height raw values
/// @throws Error if the sizes do not match or the file cannot be written.
void write_depth_png(const std::filesystem::path& path, int width, int height,
                     std::span<const std::uint16_t> depth);

}  // namespace palpate
