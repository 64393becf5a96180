// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "palpate/sources/depth_png.hpp"

// RVL, the run-length code for depth images: A. Wilson, "Fast lossless depth image compression",
// ISS 2017. Runs of zeros and of values take turns; of values the differences to the one before are
// kept. All numbers are of a variable length, three bits and a flag at a time. As in
// compressed_depth_image_transport, width and height come first.
namespace palpate {

/// Packs a depth image without loss: some ten times as fast as a PNG, and larger by a fifth.
/// @param depth  row by row, width*height raw values
/// @throws Error if the sizes do not match.
std::vector<std::byte> encode_depth_rvl(int width, int height,
                                        std::span<const std::uint16_t> depth);

/// @param name  of the message, for errors
/// @throws Error if it is cut short, or holds more or other pixels than it promises.
DepthPng parse_depth_rvl(std::span<const std::byte> bytes, const std::string& name);

}  // namespace palpate
