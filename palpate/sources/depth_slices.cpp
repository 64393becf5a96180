// SPDX-License-Identifier: Apache-2.0
#include "palpate/sources/depth_slices.hpp"

#include <algorithm>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/sources/depth_rvl.hpp"

namespace palpate {
namespace {

constexpr std::size_t slice_header = 8;
// A packet of Ethernet has 1500 bytes, of which protocols and the message around this take some
// 200.
constexpr std::size_t most_bytes = 1280;
constexpr double margin = 0.9;  // of it that is aimed at: packing again takes time
constexpr int most_rows = 16;   // what a lost slice leaves unseen
constexpr std::size_t most_slice_pixels = std::size_t{1} << 24U;  // as in RVL: no camera has more

struct SliceHeader {
  std::uint32_t number = 0;
  std::uint16_t first_row = 0, rows = 0;
  std::uint32_t own_rows = 0;
};

SliceHeader header_of(std::span<const std::byte> bytes, const std::string& name) {
  if (bytes.size() < slice_header + 8) throw Error(name, "ends too early", "it may be damaged");
  const SliceHeader slice{little_endian(bytes, 0, 4),
                          static_cast<std::uint16_t>(little_endian(bytes, 4, 2)),
                          static_cast<std::uint16_t>(little_endian(bytes, 6, 2)),
                          little_endian(bytes, slice_header + 4, 4)};  // of RVL: width, rows
  if (slice.first_row >= slice.rows || slice.own_rows > slice.rows)
    throw Error(name, "is a slice beyond its image", "it may be damaged");
  return slice;
}

// Numbers of images go round.
bool is_newer(std::uint32_t number, std::uint32_t than) {
  return static_cast<std::int32_t>(number - than) > 0;
}

}  // namespace

void encode_depth_slices(std::uint32_t number, int width, int height,
                         std::span<const std::uint16_t> depth,
                         const std::function<void(std::span<const std::byte>)>& send) {
  if (width < 1 || height < 1 || height > 65535 ||
      depth.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    throw Error("depth image",
                std::to_string(depth.size()) + " values do not make an image of " +
                    std::to_string(width) + "x" + std::to_string(height),
                "give width*height values");
  int wanted = 1;  // rows of a slice: as many as fit if they are like those of the slice before
  for (int row = 0; row < height;) {
    int rows = std::min(wanted, height - row);
    std::vector<std::byte> packed;
    for (;; rows = (rows + 1) / 2) {
      packed = encode_depth_rvl(
          width, rows,
          depth.subspan(static_cast<std::size_t>(row) * static_cast<std::size_t>(width),
                        static_cast<std::size_t>(rows) * static_cast<std::size_t>(width)));
      if (packed.size() <= most_bytes || rows == 1) break;
    }
    wanted = std::clamp(static_cast<int>(margin * static_cast<double>(most_bytes) * rows /
                                         static_cast<double>(packed.size())),
                        1, most_rows);
    std::vector<std::byte> slice;
    slice.reserve(slice_header + packed.size());
    put_little_endian(slice, number, 4);
    put_little_endian(slice, static_cast<std::uint32_t>(row), 2);
    put_little_endian(slice, static_cast<std::uint32_t>(height), 2);
    slice.insert(slice.end(), packed.begin(), packed.end());
    send(slice);
    row += rows;
  }
}

std::optional<SliceAssembler::Image> SliceAssembler::add(std::span<const std::byte> slice,
                                                         double stamp, double now,
                                                         const std::string& name) {
  const SliceHeader head = header_of(slice, name);
  rows_heard_ += head.own_rows;
  if (newest_ && !is_newer(head.number, *newest_) && !(image_ && image_->number == head.number))
    return std::nullopt;  // too late
  if (image_ && image_->number == head.number && head.rows == image_->height &&
      have_[head.first_row])
    return std::nullopt;  // once more
  const DepthPng rows = parse_depth_rvl(slice.subspan(slice_header), name);
  if (rows.height > head.rows - head.first_row)
    throw Error(name, "is a slice beyond its image", "it may be damaged");
  if (static_cast<std::size_t>(rows.width) * head.rows > most_slice_pixels)
    throw Error(name, "is a slice of an image that is too large", "it may be damaged");
  std::optional<Image> before;
  if (!image_ || image_->number != head.number) {
    before = std::exchange(image_, Image{.number = head.number,
                                         .width = rows.width,
                                         .height = head.rows,
                                         .depth = {},
                                         .missing = head.rows,
                                         .stamp = stamp,
                                         .last_slice = now});
    image_->depth.resize(static_cast<std::size_t>(rows.width) * head.rows);
    have_.assign(head.rows, false);
    newest_ = head.number;
  }
  if (rows.width != image_->width || head.rows != image_->height)
    throw Error(name, "is a slice that does not fit the others of its image", "it may be damaged");
  image_->last_slice = now;
  for (std::size_t row = head.first_row, end = row + static_cast<std::size_t>(rows.height);
       row < end; ++row) {
    if (!have_[row]) --image_->missing;
    have_[row] = true;
  }
  std::copy(rows.depth.begin(), rows.depth.end(),
            image_->depth.begin() + static_cast<std::ptrdiff_t>(head.first_row) * image_->width);
  return before;
}

std::optional<SliceAssembler::Image> SliceAssembler::take(double now, double patience) {
  if (!image_ || (image_->missing > 0 && now - image_->last_slice < patience)) return std::nullopt;
  return std::exchange(image_, std::nullopt);
}

std::optional<double> SliceAssembler::waits_since() const {
  return image_ ? std::optional<double>(image_->last_slice) : std::nullopt;
}

}  // namespace palpate
