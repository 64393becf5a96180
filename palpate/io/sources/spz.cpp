// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>

#include "palpate/io/bag/compression.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr std::uint32_t magic = 0x5053474e;  // "NGSP"
constexpr std::size_t header_size = 16;      // [bytes] that all versions have

// Takes a file's arrays one after the other. To version 3 they are one gzip; in version 4, after a
// header and a table of their sizes, each is packed by zstd.
class Unpacker {
 public:
  Unpacker(std::span<const std::byte> bytes, std::string_view name)
      : name_(name),
        bytes_(bytes),
        is_gzip_(bytes.size() < 4 || detail::load<std::uint32_t>(bytes.data(), little) != magic) {
    if (!is_gzip_) return;
    unpacked_ = decompress_gzip(bytes, detail::most_inflated(bytes.size()), name_);
    bytes_ = unpacked_;
  }
  Unpacker(const Unpacker&) = delete;
  Unpacker& operator=(const Unpacker&) = delete;

  std::vector<std::byte> header() {
    if (is_gzip_) return take(header_size);
    const auto plain = part(0, header_size + 4);
    table_ = detail::load<std::uint32_t>(&plain[header_size], little);
    next_ = table_ + entry_size * std::to_integer<std::size_t>(plain[header_size - 1]);
    return {plain.begin(), plain.begin() + header_size};
  }

  std::vector<std::byte> take(std::size_t size) {
    if (!is_gzip_) return take_zstd(size);
    const auto plain = part(next_, size);
    next_ += size;
    return {plain.begin(), plain.end()};
  }
  [[noreturn]] void fail(const std::string& reason, const std::string& remedy) const {
    throw Error(name_, reason, remedy);
  }

 private:
  static constexpr auto little = std::endian::little;
  static constexpr std::size_t entry_size = 16;  // [bytes] of the table

  [[nodiscard]] std::span<const std::byte> part(std::size_t begin, std::size_t size) const {
    if (begin > bytes_.size() || size > bytes_.size() - begin)
      fail("ends within its Gaussians", detail::cut_short);
    return bytes_.subspan(begin, size);
  }

  std::vector<std::byte> take_zstd(std::size_t size) {
    const auto packed = detail::load<std::uint64_t>(part(table_, entry_size).data(), little);
    if (packed > bytes_.size()) fail("ends within its Gaussians", detail::cut_short);
    std::vector<std::byte> bytes =
        decompress_zstd(part(next_, static_cast<std::size_t>(packed)), size, name_);
    if (bytes.size() != size)
      fail("an array has fewer Gaussians than its header promises", detail::cut_short);
    table_ += entry_size;
    next_ += static_cast<std::size_t>(packed);
    return bytes;
  }

  std::string name_;
  std::vector<std::byte> unpacked_;  // of a gzip
  std::span<const std::byte> bytes_;
  bool is_gzip_;
  std::size_t table_ = 0, next_ = 0;  // places of the next array's sizes, and of its bytes
};

double of_half(std::uint16_t half) {
  const int exponent = half >> 10U & 31U;
  const double mantissa = half & 1023U;
  const double size =
      exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024.0 + mantissa, exponent - 25);
  return exponent == 31 ? NAN : (half & 0x8000U) != 0 ? -size : size;
}

// x, y, z, w of the three smallest: 2 bits say which is left out, then 10 each, a sign the first.
Eigen::Vector4d smallest_three(std::uint32_t bits) {
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  const auto largest = static_cast<Eigen::Index>(bits >> 30U);
  for (Eigen::Index i = 4; i-- > 0;) {
    if (i == largest) continue;
    const double size = (bits & 511U) / (511.0 * std::numbers::sqrt2);
    q[i] = (bits & 512U) != 0 ? -size : size;
    bits >>= 10U;
  }
  q[largest] = std::sqrt(std::max(1.0 - q.squaredNorm(), 0.0));
  return q;
}

}  // namespace

PointFile parse_spz(std::span<const std::byte> bytes, std::string_view name) {
  constexpr auto little = std::endian::little;
  Unpacker file(bytes, name);
  const std::vector<std::byte> header = file.header();
  const auto version = detail::load<std::uint32_t>(&header[4], little);
  const std::size_t count = detail::load<std::uint32_t>(&header[8], little);
  const auto fraction = std::to_integer<int>(header[13]);  // bits of a coordinate
  if (detail::load<std::uint32_t>(header.data(), little) != magic)
    file.fail("it is no SPZ: it does not begin with NGSP", "give a splat as FILE.spz");
  if (version < 1 || version > 4)
    file.fail("SPZ version " + std::to_string(version) + " is not known",
              "write it as version 1 to 4");
  const std::size_t place_size = version == 1 ? 2 : 3;
  const std::size_t turn_size = version < 3 ? 3 : 4;
  if (count > detail::most_inflated(bytes.size()) / (3 * place_size + 7 + turn_size) ||
      fraction > 24)
    file.fail("its header promises " + std::to_string(count) + " Gaussians, with " +
                  std::to_string(fraction) + " bits of fraction, more than it can hold",
              detail::cut_short);
  const std::vector<std::byte> places = file.take(3 * place_size * count);
  const std::vector<std::byte> opacities = file.take(count);
  const std::vector<std::byte> colours = file.take(3 * count);
  const std::vector<std::byte> scales = file.take(3 * count);
  const std::vector<std::byte> turns = file.take(turn_size * count);

  PointFile cloud;
  SplatColumns& splat = cloud.splat.emplace();
  cloud.encoding = "SPZ version " + std::to_string(version);
  for (std::size_t i = 0; i < count; ++i) {
    Vec3 place, scale;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::byte* const at = &places[place_size * (3 * i + k)];
      const int top = std::to_integer<int>(at[place_size - 1]);  // of a signed number
      const auto axis = static_cast<Eigen::Index>(k);
      place[axis] = version == 1 ? of_half(detail::load<std::uint16_t>(at, little))
                                 : std::ldexp((top < 128 ? top : top - 256) * 65536 +
                                                  detail::load<std::uint16_t>(at, little),
                                              -fraction);
      scale[axis] = std::to_integer<int>(scales[3 * i + k]) / 16.0 - 10.0;
      const double harmonic = (std::to_integer<int>(colours[3 * i + k]) / 255.0 - 0.5) / 0.15;
      cloud.colours.push_back(detail::colour_byte(detail::colour_share(harmonic)));
    }
    Eigen::Vector4d turn;  // x, y, z, w
    const std::byte* const at = &turns[turn_size * i];
    if (version >= 3) {
      turn = smallest_three(detail::load<std::uint32_t>(at, little));
    } else {
      for (int k = 0; k < 3; ++k) turn[k] = std::to_integer<int>(at[k]) / 127.5 - 1.0;
      turn[3] = 0.0;
      turn[3] = std::sqrt(std::max(1.0 - turn.squaredNorm(), 0.0));
    }
    const double opacity = std::to_integer<int>(opacities[i]) / 255.0;
    cloud.points.push_back(place);
    splat.add(scale, opacity, Eigen::Quaterniond(turn));
  }
  cloud.width = count;
  cloud.non_finite = detail::count_non_finite(cloud.points);
  return cloud;
}

}  // namespace palpate
