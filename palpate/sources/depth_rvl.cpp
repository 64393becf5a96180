// SPDX-License-Identifier: Apache-2.0
#include "palpate/sources/depth_rvl.hpp"

#include <algorithm>
#include <cstring>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

constexpr std::uint32_t largest_rvl_side = 16384;  // [px] as in a PNG
// Eight bytes can promise any number of zeros: no camera has more pixels than this.
constexpr std::size_t most_pixels = std::size_t{1} << 24U;
constexpr std::size_t header = 8;  // width and height
constexpr int nibbles_per_word = 8;

// Nibbles, the first one in a word's highest bits. Words are little-endian: those of the machines
// that wrote the first of them.
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
      word_ = little_endian(from_, at_, 4);
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

}  // namespace

std::vector<std::byte> encode_depth_rvl(int width, int height,
                                        std::span<const std::uint16_t> depth) {
  const auto columns = static_cast<std::uint32_t>(width);
  const auto rows = static_cast<std::uint32_t>(height);
  if (width < 1 || height < 1 || columns > largest_rvl_side || rows > largest_rvl_side ||
      depth.size() != std::size_t{columns} * rows)
    throw Error("depth image",
                std::to_string(depth.size()) + " values do not make an image of " +
                    std::to_string(width) + "x" + std::to_string(height),
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
  const std::uint32_t width = little_endian(bytes, 0, 4);
  const std::uint32_t height = little_endian(bytes, 4, 4);
  const std::size_t count = std::size_t{width} * height;
  if (count == 0 || width > largest_rvl_side || height > largest_rvl_side || count > most_pixels)
    throw Error(
        name,
        "promises an image of " + std::to_string(width) + "x" + std::to_string(height) + " pixels",
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

}  // namespace palpate
