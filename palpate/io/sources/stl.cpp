// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <bit>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

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
  if (bytes.size() >= header &&
      detail::load<std::uint32_t>(&bytes[80], std::endian::little) ==
          (bytes.size() - header) / facet &&
      (bytes.size() - header) % facet == 0) {
    file.encoding = "binary";
    for (std::size_t at = header; at < bytes.size(); at += facet) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        Vec3 place;
        for (int axis = 0; axis < 3; ++axis)
          place[axis] = detail::load<float>(
              &bytes[at + 12 + 12 * corner + 4 * static_cast<std::size_t>(axis)],
              std::endian::little);
        welder.corner(finite(place));
      }
    }
  } else {
    file.encoding = "ascii";
    std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (detail::next_token(text) != "solid")
      fail(
          "it is no STL: its size does not fit its number of triangles, nor does it begin with "
          "'solid'");
    for (std::string_view word = detail::next_token(text); !word.empty();
         word = detail::next_token(text)) {
      if (word != "vertex") continue;
      Vec3 place;
      for (int axis = 0; axis < 3; ++axis) {
        const std::string_view token = detail::next_token(text);
        const std::optional<double> number = detail::to_number(token);
        if (!number)
          fail("a corner has '" + std::string(token.substr(0, 20)) + "' for a coordinate");
        place[axis] = *number;
      }
      welder.corner(finite(place));
    }
    if (!welder.is_whole()) fail("its last triangle has no three corners");
  }
  file.width = file.points.size();
  return file;
}

}  // namespace palpate
