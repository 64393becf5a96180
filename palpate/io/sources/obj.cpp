// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <vector>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/point_file_detail.hpp"

namespace palpate {

PointFile parse_obj(std::span<const std::byte> bytes, std::string_view name) {
  constexpr const char* correct_line = "correct the line";
  PointFile mesh;
  mesh.encoding = "ascii";
  detail::Cursor file(bytes, name);
  std::vector<std::uint32_t> corners;
  // `12`, `12/3`, `12//4`, `12/3/4`: from 1; below 0, from the vertex read last.
  const auto corner = [&](std::string_view token) {
    std::int64_t number = 0;
    const char* const end = token.data() + token.size();
    const auto [stop, error] = std::from_chars(token.data(), end, number);
    const auto count = static_cast<std::int64_t>(mesh.points.size());
    const bool is_number = error == std::errc{} && (stop == end || *stop == '/');
    if (!is_number || number == 0 || number > count || number < -count)
      file.fail_in_line(detail::quoted(token) + " is not one of the " + std::to_string(count) +
                            " vertices before it, counted from 1, or from -1 backwards",
                        correct_line);
    return static_cast<std::uint32_t>(number > 0 ? number - 1 : count + number);
  };
  while (const auto line = file.next_line()) {
    std::string_view rest = *line;
    const std::string_view keyword = detail::next_token(rest);
    if (keyword == "v") {
      Vec3 place;
      for (double& coordinate : place) {
        const auto number = detail::to_number(detail::next_token(rest));
        if (!number) file.fail_in_line("a vertex is `v X Y Z`", correct_line);
        coordinate = *number;
      }
      if (!place.allFinite()) file.fail_in_line("a vertex is not finite", correct_line);
      mesh.points.push_back(place);
    } else if (keyword == "f") {
      corners.clear();
      for (auto token = detail::next_token(rest); !token.empty(); token = detail::next_token(rest))
        corners.push_back(corner(token));
      if (corners.size() < 3) file.fail_in_line("a face has three corners or more", correct_line);
      for (std::size_t i = 2; i < corners.size(); ++i)
        mesh.triangles.push_back({corners[0], corners[i - 1], corners[i]});
    }
  }
  mesh.width = mesh.points.size();
  return mesh;
}

}  // namespace palpate
