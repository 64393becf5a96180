// SPDX-License-Identifier: Apache-2.0
#include "palpate/sources/stl.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <map>
#include <string>
#include <tuple>

#include "palpate/core/error.hpp"
#include "palpate/sources/files.hpp"
#include "palpate/sources/little_endian.hpp"

namespace palpate {
namespace {

constexpr std::uintmax_t largest_stl = std::uintmax_t{1} << 28;

// Joins corners that are at the same place.
class Welder {
 public:
  explicit Welder(PointFile& file) : file_(file) {}
  void corner(const Vec3& at) {
    const std::tuple key(at.x(), at.y(), at.z());
    const auto [known, is_new] =
        known_.try_emplace(key, static_cast<std::uint32_t>(file_.points.size()));
    if (is_new) file_.points.push_back(at);
    triangle_[corners_++] = known->second;
    if (corners_ < 3) return;
    corners_ = 0;
    file_.triangles.push_back(triangle_);
  }
  [[nodiscard]] bool is_whole() const { return corners_ == 0; }

 private:
  PointFile& file_;
  std::map<std::tuple<double, double, double>, std::uint32_t> known_;
  std::array<std::uint32_t, 3> triangle_{};
  std::size_t corners_ = 0;
};

std::string_view next_word(std::string_view& text) {
  constexpr std::string_view space = " \t\r\n";
  const std::size_t begin = std::min(text.find_first_not_of(space), text.size());
  const std::size_t end = std::min(text.find_first_of(space, begin), text.size());
  const std::string_view word = text.substr(begin, end - begin);
  text.remove_prefix(end);
  return word;
}

}  // namespace

PointFile parse_stl(std::span<const std::byte> bytes, std::string_view name) {
  constexpr std::size_t header = 84;
  constexpr std::size_t facet = 50;
  const auto fail = [&](const std::string& what) {
    throw Error(std::string(name), what, "write the mesh again as a binary STL");
  };
  PointFile file;
  Welder welder(file);
  const auto finite = [&](const Vec3& at) {
    if (!at.allFinite()) fail("a corner is not finite");
    return at;
  };
  if (bytes.size() >= header && little_endian(bytes, 80, 4) == (bytes.size() - header) / facet &&
      (bytes.size() - header) % facet == 0) {
    file.encoding = "binary";
    for (std::size_t at = header; at < bytes.size(); at += facet) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        Vec3 place;
        for (std::size_t axis = 0; axis < 3; ++axis)
          place[static_cast<Eigen::Index>(axis)] = static_cast<double>(
              std::bit_cast<float>(little_endian(bytes, at + 12 + 12 * corner + 4 * axis, 4)));
        welder.corner(finite(place));
      }
    }
  } else {
    file.encoding = "ascii";
    std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (next_word(text) != "solid")
      fail(
          "it is no STL: its size does not fit its number of triangles, nor does it begin with "
          "'solid'");
    for (std::string_view word = next_word(text); !word.empty(); word = next_word(text)) {
      if (word != "vertex") continue;
      Vec3 place;
      for (int axis = 0; axis < 3; ++axis) {
        const std::string_view number = next_word(text);
        const auto [end, error] =
            std::from_chars(number.data(), number.data() + number.size(), place[axis]);
        if (error != std::errc() || end != number.data() + number.size())
          fail("a corner has '" + std::string(number.substr(0, 20)) + "' for a coordinate");
      }
      welder.corner(finite(place));
    }
    if (!welder.is_whole()) fail("its last triangle has no three corners");
  }
  file.width = file.points.size();
  return file;
}

PointFile read_stl(const std::filesystem::path& path) {
  return parse_stl(read_file(path, largest_stl), path.string());
}

}  // namespace palpate
