// SPDX-License-Identifier: Apache-2.0
#pragma once

// RVL, the run-length code for depth images: A. Wilson, "Fast lossless depth image compression",
// ISS 2017. Runs of zeros and of values, as differences, take turns; numbers are of a variable
// length. As in compressed_depth_image_transport, width and height come first.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "palpate/io/sources/depth_png.hpp"

namespace palpate {

/// Packs a depth image without loss: some ten times as fast as a PNG, and larger by a fifth.
/// @param depth  row by row, width*height raw values
/// @throws Error if the sizes do not match.
std::vector<std::byte> encode_depth_rvl(int width, int height,
                                        std::span<const std::uint16_t> depth);

/// @param name  of the message, for errors
/// @throws Error if it is cut short, or holds more or other pixels than it promises.
DepthPng parse_depth_rvl(std::span<const std::byte> bytes, const std::string& name);

// Depth images in slices of some rows, each of which fits into one packet and can be read without
// the others: what a link loses is a hole of a few rows, which nothing waits for.

/// Hands each slice to `send` as soon as it is packed: a header of 8 bytes (u32 number of the
/// image, u16 first row, u16 rows of the image; little-endian), then its rows as RVL.
/// @param number  of the image
/// @param depth   row by row, width*height raw values
/// @throws Error if the sizes do not match.
void encode_depth_slices(std::uint32_t number, int width, int height,
                         std::span<const std::uint16_t> depth,
                         const std::function<void(std::span<const std::byte>)>& send);

/// Puts images together from their slices. A slice of a newer image ends the one before.
class SliceAssembler {
 public:
  struct Image {
    std::uint32_t number = 0;
    int width = 0, height = 0;         ///< [px]
    std::vector<std::uint16_t> depth;  ///< 0 where a slice is missing
    int missing = 0;                   ///< rows
    double stamp = 0.0;                ///< [s] as given with its first slice
    double last_slice = 0.0;           ///< [s] as given with its last slice
  };

  /// @param stamp  [s] of the capture, by any clock  @param now  [s] by any other
  /// @param name   of the message, for errors
  /// @return the image before, as far as it came, if this slice is of a newer one
  /// @throws Error if the slice is damaged, or does not fit the others of its image.
  std::optional<Image> add(std::span<const std::byte> slice, double stamp, double now,
                           const std::string& name);

  /// The image of which slices came last, if it is complete, or its last one came `patience` ago.
  std::optional<Image> take(double now, double patience);
  /// [s] when its last slice came; none if there is no image.
  [[nodiscard]] std::optional<double> waits_since() const;
  /// How many rows came so far, those that came twice or too late among them.
  [[nodiscard]] std::uint64_t rows_heard() const { return rows_heard_; }

 private:
  std::optional<Image> image_;
  std::vector<bool> have_;  // of its rows
  std::uint64_t rows_heard_ = 0;
  std::optional<std::uint32_t> newest_;  // number of an image that was given, or is put together
};

}  // namespace palpate
