// SPDX-License-Identifier: Apache-2.0
// depth_png.cpp without libpng: the page's JavaScript packs and unpacks, and interlaced images,
// palettes and fewer than 8 bits are refused.
#include <array>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>

#include <zlib.h>

#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/files.hpp"
#include "palpate/kernel/core/error.hpp"

#include "site/page.hpp"

namespace palpate {
namespace {

constexpr std::uint32_t largest_side = 16384;  // [px] as in validate(Intrinsics)
constexpr std::uintmax_t largest_file = std::uintmax_t{1} << 30;
constexpr std::string_view signature("\x89PNG\r\n\x1a\n", 8);

using Bytes = std::span<const std::byte>;

std::uint32_t number(Bytes bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value = value << 8U | std::to_integer<std::uint32_t>(bytes[at + i]);
  return value;
}

std::uint32_t checksum(Bytes bytes) {
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

struct Image {
  std::uint32_t width = 0, height = 0, bits = 0, colour = 0, channels = 0;
  std::vector<std::byte> rows;  // unfiltered, big-endian

  // The value of a pixel's channel, in 16 bits or the upper 8 of them.
  [[nodiscard]] unsigned value(std::size_t pixel, std::size_t channel) const {
    const std::size_t at = pixel * channels + channel;
    if (bits == 8) return std::to_integer<unsigned>(rows[at]);
    return std::to_integer<unsigned>(rows[2 * at]) << 8U |
           std::to_integer<unsigned>(rows[2 * at + 1]);
  }
  [[nodiscard]] std::uint8_t byte(std::size_t pixel, std::size_t channel) const {
    const unsigned full = value(pixel, channel);
    return static_cast<std::uint8_t>(bits == 8 ? full : (full * 255 + 32895) >> 16U);
  }
};

// What a filter of type 1 to 4 predicts of a byte.
int predicted(int filter, int left, int above, int corner) {
  if (filter == 1) return left;
  if (filter == 2) return above;
  if (filter == 3) return (left + above) / 2;
  const int a = std::abs(above - corner);
  const int b = std::abs(left - corner);
  const int c = std::abs(left + above - 2 * corner);
  return a <= b && a <= c ? left : b <= c ? above : corner;
}

Image decode(Bytes bytes, const std::string& name, const char* needed) {
  if (bytes.size() < signature.size() ||
      std::memcmp(bytes.data(), signature.data(), signature.size()) != 0)
    throw Error(name, bytes.empty() ? "is empty" : "is not a PNG image", needed);
  const auto damaged = [&](const std::string& why) {
    return Error(name, "is a damaged PNG: " + why,
                 "copy or record it again, it may have been cut short");
  };
  Image image;
  std::vector<std::byte> packed;
  std::string_view kind;
  for (std::size_t at = signature.size(); kind != "IEND";) {
    constexpr std::size_t frame = 12;  // [bytes] length, kind and checksum of a chunk
    if (bytes.size() < at + frame || bytes.size() - at - frame < number(bytes, at))
      throw damaged("it ends too early");
    const std::size_t size = number(bytes, at);
    kind = {reinterpret_cast<const char*>(bytes.data()) + at + 4, 4};
    const Bytes data = bytes.subspan(at + 8, size);
    if (checksum(bytes.subspan(at + 4, size + 4)) != number(bytes, at + 8 + size))
      throw damaged(std::string(kind) + ": CRC error");
    if (kind == "IHDR" && size == 13) {
      constexpr std::array<std::uint32_t, 7> channels{1, 0, 3, 0, 2, 0, 4};
      image = {.width = number(data, 0),
               .height = number(data, 4),
               .bits = std::to_integer<std::uint32_t>(data[8]),
               .colour = std::to_integer<std::uint32_t>(data[9])};
      image.channels = image.colour < channels.size() ? channels[image.colour] : 0;
      if (image.channels == 0 || (image.bits != 8 && image.bits != 16) || data[12] != std::byte{0})
        throw Error(name, "is a PNG of a kind which this page cannot read",
                    "a grey or colour PNG of 8 or 16 bits, not interlaced, is needed");
    }
    if (kind == "IDAT") packed.insert(packed.end(), data.begin(), data.end());
    at += frame + size;
  }
  const std::string size = std::to_string(image.width) + "x" + std::to_string(image.height);
  if (image.width > largest_side || image.height > largest_side)
    throw Error(name, "is an image of " + size + " pixels",
                "images up to 16384x16384 can be read; it may be damaged");
  const std::size_t step = image.channels * image.bits / 8;
  const std::size_t row = image.width * step;
  constexpr std::size_t best_ratio = 1032;  // of deflate
  if (row * image.height / best_ratio > bytes.size())
    throw Error(name,
                "promises " + size + " pixels, more than its " + std::to_string(bytes.size()) +
                    " bytes can hold",
                "copy or record it again, it may have been cut short");
  const std::vector<std::byte> filtered = site::unpack_zlib(packed, (row + 1) * image.height);
  if (row == 0 || filtered.size() != (row + 1) * image.height)
    throw damaged("Not enough image data");
  image.rows.resize(row * image.height);
  for (std::size_t v = 0; v < image.height; ++v) {
    const std::byte* in = filtered.data() + v * (row + 1);
    std::byte* out = image.rows.data() + v * row;
    const auto filter = std::to_integer<int>(*in++);
    if (filter > 4) throw damaged("bad adaptive filter value");
    for (std::size_t i = 0; i < row; ++i) {
      const int left = i < step ? 0 : std::to_integer<int>(out[i - step]);
      const int above = v == 0 ? 0 : std::to_integer<int>(*(out + i - row));
      const int corner = v == 0 || i < step ? 0 : std::to_integer<int>(*(out + i - row - step));
      const int more = filter == 0 ? 0 : predicted(filter, left, above, corner);
      out[i] = static_cast<std::byte>(std::to_integer<int>(in[i]) + more);
    }
  }
  return image;
}

}  // namespace

DepthPng parse_depth_png(std::span<const std::byte> bytes, const std::string& name) {
  const char* const needed = "a 16-bit grey PNG is needed";
  const Image image = decode(bytes, name, needed);
  if (image.bits != 16 || image.colour != 0) {
    constexpr std::array names{"grey", "", "colour", "", "grey and alpha", "", "colour and alpha"};
    throw Error(name,
                "is a PNG of " + std::to_string(image.bits) + "-bit " + names[image.colour] +
                    ", not of depth",
                needed);
  }
  DepthPng depth{static_cast<int>(image.width), static_cast<int>(image.height), {}};
  for (std::size_t i = 0; i < std::size_t{image.width} * image.height; ++i)
    depth.depth.push_back(static_cast<std::uint16_t>(image.value(i, 0)));
  return depth;
}

DepthPng read_depth_png(const std::filesystem::path& path) {
  return parse_depth_png(read_file(path, largest_file), path.string());
}

LightPng read_light_png(const std::filesystem::path& path, bool in_colour) {
  const std::vector<std::byte> bytes = read_file(path, largest_file);
  const Image image = decode(bytes, path.string(), "a PNG is needed");
  LightPng light{static_cast<int>(image.width), static_cast<int>(image.height), {}};
  const bool is_grey = image.channels < 3;
  for (std::size_t i = 0; i < std::size_t{image.width} * image.height; ++i) {
    for (std::size_t channel = 0; in_colour && channel < 3; ++channel)
      light.values.push_back(image.byte(i, is_grey ? 0 : channel));
    if (in_colour) continue;
    // libpng's weights of red, green and blue
    const unsigned grey =
        is_grey
            ? image.byte(i, 0)
            : (6968U * image.byte(i, 0) + 23434U * image.byte(i, 1) + 2366U * image.byte(i, 2)) >>
                  15U;
    light.values.push_back(static_cast<std::uint8_t>(grey));
  }
  return light;
}

std::vector<std::byte> encode_depth_png(int width, int height,
                                        std::span<const std::uint16_t> depth) {
  std::vector<std::byte> rows;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (i % static_cast<std::size_t>(width) == 0) rows.push_back(std::byte{0});  // no filter
    rows.push_back(static_cast<std::byte>(depth[i] >> 8U));
    rows.push_back(static_cast<std::byte>(depth[i]));
  }
  std::vector<std::byte> png;
  const auto put = [&png](std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8)
      png.push_back(static_cast<std::byte>(value >> static_cast<unsigned>(shift)));
  };
  const auto chunk = [&](std::string_view kind, Bytes data) {
    put(static_cast<std::uint32_t>(data.size()));
    const std::size_t begin = png.size();
    for (const char c : kind) png.push_back(static_cast<std::byte>(c));
    png.insert(png.end(), data.begin(), data.end());
    put(checksum(Bytes(png).subspan(begin)));
  };
  for (const char c : signature) png.push_back(static_cast<std::byte>(c));
  std::array<std::byte, 13> header{};
  for (std::size_t i = 0; i < 4; ++i) {
    header[i] = static_cast<std::byte>(static_cast<unsigned>(width) >> (24 - 8 * i));
    header[4 + i] = static_cast<std::byte>(static_cast<unsigned>(height) >> (24 - 8 * i));
  }
  header[8] = std::byte{16};
  chunk("IHDR", header);
  chunk("IDAT", site::pack_zlib(rows));
  chunk("IEND", {});
  return png;
}

}  // namespace palpate
