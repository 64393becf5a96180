// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/depth_rvl.hpp"

#include <algorithm>
#include <utility>

#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr std::uint32_t largest_rvl_side = 16384;  // [px] as in a PNG
// Eight bytes can promise any number of zeros: no camera has more pixels than this.
constexpr std::size_t most_pixels = std::size_t{1} << 24U;
constexpr std::size_t header = 8;  // width and height
constexpr int nibbles_per_word = 8;

// The lowest `size` bytes of a number, at most 4.
void put_little_endian(std::vector<std::byte>& to, std::uint32_t value, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i)
    to.push_back(static_cast<std::byte>(value >> (8 * i) & 0xffU));
}

template <class Number>
Number little_endian(std::span<const std::byte> bytes, std::size_t at) {
  return detail::load<Number>(&bytes[at], std::endian::little);
}

// Nibbles, the first one in a word's highest bits, in little-endian words.
class NibbleWriter {
 public:
  explicit NibbleWriter(std::vector<std::byte>& to) : to_(to) {}

  void number(std::uint32_t value) {
    do {
      std::uint32_t nibble = value & 7U;
      value >>= 3U;
      if (value != 0) nibble |= 8U;
      word_ = word_ << 4U | nibble;
      if (++count_ == nibbles_per_word) put();
    } while (value != 0);
  }
  void finish() {
    if (count_ == 0) return;
    word_ <<= 4U * static_cast<std::uint32_t>(nibbles_per_word - count_);
    put();
  }

 private:
  void put() {
    put_little_endian(to_, word_, 4);
    word_ = 0;
    count_ = 0;
  }

  std::vector<std::byte>& to_;
  std::uint32_t word_ = 0;
  int count_ = 0;
};

class NibbleReader {
 public:
  NibbleReader(std::span<const std::byte> from, const std::string& name)
      : from_(from), name_(name) {}

  std::uint32_t number() {
    std::uint32_t value = 0;
    for (std::uint32_t shift = 0; shift < 32; shift += 3) {
      const std::uint32_t nibble = next();
      value |= (nibble & 7U) << shift;
      if ((nibble & 8U) == 0) return value;
    }
    throw Error(name_, "has a number with too many digits", "it may be damaged");
  }

 private:
  std::uint32_t next() {
    if (left_ == 0) {
      if (from_.size() - at_ < 4) throw Error(name_, "ends too early", "it may be damaged");
      word_ = little_endian<std::uint32_t>(from_, at_);
      at_ += 4;
      left_ = nibbles_per_word;
    }
    --left_;
    const std::uint32_t nibble = word_ >> 28U;
    word_ <<= 4U;
    return nibble;
  }

  std::span<const std::byte> from_;
  const std::string& name_;
  std::size_t at_ = 0;
  std::uint32_t word_ = 0;
  int left_ = 0;
};

constexpr std::size_t slice_header = 8;
// A packet of Ethernet has 1500 bytes, of which protocols and the message take some 200.
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
  const SliceHeader slice{little_endian<std::uint32_t>(bytes, 0),
                          little_endian<std::uint16_t>(bytes, 4),
                          little_endian<std::uint16_t>(bytes, 6),
                          little_endian<std::uint32_t>(bytes, slice_header + 4)};  // of RVL
  if (slice.first_row >= slice.rows || slice.own_rows > slice.rows)
    throw Error(name, "is a slice beyond its image", "it may be damaged");
  return slice;
}

// Numbers of images go round.
bool is_newer(std::uint32_t number, std::uint32_t than) {
  return static_cast<std::int32_t>(number - than) > 0;
}

}  // namespace

std::vector<std::byte> encode_depth_rvl(int width, int height,
                                        std::span<const std::uint16_t> depth) {
  const auto columns = static_cast<std::uint32_t>(width);
  const auto rows = static_cast<std::uint32_t>(height);
  if (width < 1 || height < 1 || columns > largest_rvl_side || rows > largest_rvl_side ||
      depth.size() != std::size_t{columns} * rows)
    throw Error("depth image",
                std::to_string(depth.size()) + " values do not make an image of " +
                    size_text(width, height),
                "give width*height values, sides up to 16384");
  std::vector<std::byte> bytes;
  bytes.reserve(header + depth.size());
  for (const std::uint32_t side : {columns, rows}) put_little_endian(bytes, side, 4);
  NibbleWriter writer(bytes);
  std::int32_t previous = 0;
  for (auto pixel = depth.begin(); pixel != depth.end();) {
    const auto values = std::find_if(pixel, depth.end(), [](auto raw) { return raw != 0; });
    const auto end = std::find(values, depth.end(), std::uint16_t{0});
    writer.number(static_cast<std::uint32_t>(values - pixel));
    writer.number(static_cast<std::uint32_t>(end - values));
    for (pixel = values; pixel != end; ++pixel) {
      const std::int32_t difference = *pixel - previous;
      // Small ones of either sign become small numbers: 0, -1, 1, -2, ... are 0, 1, 2, 3, ...
      const std::int32_t folded = difference >= 0 ? 2 * difference : -2 * difference - 1;
      writer.number(static_cast<std::uint32_t>(folded));
      previous = *pixel;
    }
  }
  writer.finish();
  return bytes;
}

DepthPng parse_depth_rvl(std::span<const std::byte> bytes, const std::string& name) {
  if (bytes.size() < header) throw Error(name, "ends too early", "it may be damaged");
  const auto width = little_endian<std::uint32_t>(bytes, 0);
  const auto height = little_endian<std::uint32_t>(bytes, 4);
  const std::size_t count = std::size_t{width} * height;
  if (count == 0 || width > largest_rvl_side || height > largest_rvl_side || count > most_pixels)
    throw Error(name, "promises an image of " + size_text(width, height) + " pixels",
                "it may be damaged");
  DepthPng image{static_cast<int>(width), static_cast<int>(height), {}};
  image.depth.reserve(std::min(count, 8 * bytes.size()));
  NibbleReader reader(bytes.subspan(header), name);
  std::int64_t previous = 0;
  while (image.depth.size() < count) {
    const std::size_t zeros = reader.number();
    const std::size_t values = reader.number();
    if (zeros + values == 0 || zeros + values > count - image.depth.size())
      throw Error(name, "has a different number of pixels than declared", "it may be damaged");
    image.depth.resize(image.depth.size() + zeros);
    for (std::size_t i = 0; i < values; ++i) {
      const std::uint32_t folded = reader.number();
      previous += folded % 2 == 0 ? std::int64_t{folded / 2} : -std::int64_t{folded / 2} - 1;
      if (previous < 1 || previous > 65535)
        throw Error(name, "has a depth value out of range", "it may be damaged");
      image.depth.push_back(static_cast<std::uint16_t>(previous));
    }
  }
  return image;
}

void encode_depth_slices(std::uint32_t number, int width, int height,
                         std::span<const std::uint16_t> depth,
                         const std::function<void(std::span<const std::byte>)>& send) {
  if (width < 1 || height < 1 || height > 65535 ||
      depth.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    throw Error("depth image",
                std::to_string(depth.size()) + " values do not make an image of " +
                    size_text(width, height),
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
