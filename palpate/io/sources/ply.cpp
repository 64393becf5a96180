// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <stdexcept>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

using detail::Column;
using detail::Cursor;
using detail::cut_short;
using detail::Scalar;

constexpr const char* not_ply = "check that this is a PLY file";
constexpr const char* correct_line = "correct the line";

struct Element {
  std::string_view name;
  std::size_t rows = 0;
  std::vector<Column> properties;

  [[nodiscard]] std::string text() const { return "element " + detail::quoted(name); }
};

// Triangles, made of the lists of an element's rows.
struct Faces {
  std::uint64_t vertices = 0;  // as many as the header declares
  bool strips = false;         // every three neighbours of a list are a triangle; -1 begins anew
  std::vector<std::array<std::uint32_t, 3>> triangles{};
};

struct PlyHeader {
  std::string_view encoding;
  std::vector<Element> elements;
};

const Scalar* type_of(const Cursor& file, std::string_view name) {
  const Scalar* found = detail::find_scalar([&](const Scalar& known) {
    return !known.ply.empty() && (known.ply == name || known.name == name);
  });
  if (found == nullptr)
    file.fail_in_line(detail::quoted(name) + " is not a type of PLY",
                      "types are char, uchar, short, ushort, int, uint, float and double");
  return found;
}

Column read_property(const Cursor& file, std::string_view rest) {
  Column property;
  std::string_view type = detail::next_token(rest);
  if (type == "list") {
    property.length = type_of(file, detail::next_token(rest));
    if (property.length->is_float)
      file.fail_in_line("a list's length cannot be a float", correct_line);
    type = detail::next_token(rest);
  }
  property.type = type_of(file, type);
  property.name = detail::next_token(rest);
  if (property.name.empty() || !detail::next_token(rest).empty())
    file.fail_in_line("a property is `property TYPE NAME` or `property list TYPE TYPE NAME`",
                      correct_line);
  return property;
}

PlyHeader read_ply_header(Cursor& file) {
  const std::string_view magic = file.next_line().value_or("");
  if (magic != "ply") file.fail("does not begin with `ply`", not_ply);
  PlyHeader header;
  while (const auto line = file.next_full_line()) {
    std::string_view rest = *line;
    const std::string_view keyword = detail::next_token(rest);
    if (keyword == "format") {
      header.encoding = detail::next_token(rest);
      const std::string_view version = detail::next_token(rest);
      if (header.encoding != "ascii" && header.encoding != "binary_little_endian" &&
          header.encoding != "binary_big_endian") {
        file.fail_in_line("format " + detail::quoted(header.encoding) + " is not known",
                          "it can be ascii, binary_little_endian or binary_big_endian");
      }
      if (version != "1.0")
        file.fail_in_line("PLY version " + detail::quoted(version) + " is not known",
                          "write the file as version 1.0");
    } else if (keyword == "element") {
      Element element;
      element.name = detail::next_token(rest);
      const auto rows = detail::to_count(detail::next_token(rest));
      if (!rows || !detail::next_token(rest).empty())
        file.fail_in_line("an element is `element NAME COUNT`", correct_line);
      element.rows = *rows;
      header.elements.push_back(element);
    } else if (keyword == "property") {
      if (header.elements.empty()) file.fail_in_line("a property before any element", correct_line);
      header.elements.back().properties.push_back(read_property(file, rest));
    } else if (keyword == "end_header") {
      if (header.encoding.empty()) file.fail("the header has no format line", not_ply);
      return header;
    } else if (keyword != "comment" && keyword != "obj_info") {
      file.fail_in_line(detail::quoted(keyword) + " does not begin a line of a PLY header",
                        not_ply);
    }
  }
  file.fail("the header has no end_header line", cut_short);
}

// The properties of these names; none unless the element has each of them once, and not as a list.
template <std::size_t N>
std::optional<std::array<Column*, N>> columns_named(const std::array<std::string_view, N>& names,
                                                    Element& element) {
  std::array<Column*, N> found{};
  for (std::size_t i = 0; i < N; ++i) {
    for (Column& property : element.properties) {
      if (property.name != names[i]) continue;
      if (found[i] != nullptr || property.length != nullptr) return std::nullopt;
      found[i] = &property;
    }
    if (found[i] == nullptr) return std::nullopt;
  }
  return found;
}

// Asks for some properties as coordinates. False unless the element has them.
template <std::size_t N>
bool ask_for(const std::array<std::string_view, N>& names, Element& element,
             std::vector<Vec3>& into) {
  const auto columns = columns_named(names, element);
  if (!columns) return false;
  for (std::size_t axis = 0; axis < N; ++axis) detail::ask_for(*(*columns)[axis], into, axis);
  return true;
}

// Asks for the points' colours, if there is one of each channel, of bytes or floats from 0 to 1 or
// a splat's. Nothing depends on a colour: one that is no number is black.
void ask_for_colours(bool as_splat, Element& element, std::vector<std::uint8_t>& into) {
  const auto columns = as_splat ? columns_named<3>({"f_dc_0", "f_dc_1", "f_dc_2"}, element)
                                : columns_named<3>({"red", "green", "blue"}, element);
  if (!columns || std::any_of(columns->begin(), columns->end(), [](const Column* column) {
        return column->type->name != "uint8" && !column->type->is_float;
      }))
    return;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    Column& column = *(*columns)[channel];
    const double unit = column.type->is_float ? 1.0 : 255.0;
    column.is_needed = false;
    column.prepare = [&into](std::size_t rows) { into.resize(3 * rows); };
    column.put = [&into, channel, unit, as_splat](std::size_t row, double value) {
      into[3 * row + channel] =
          detail::colour_byte(as_splat ? detail::colour_share(value) : value / unit);
    };
  }
}

// @throws std::invalid_argument where a corner is no vertex
void add_triangles(std::span<const std::int64_t> corners, Faces& faces) {
  for (const std::int64_t corner : corners) {
    if (faces.strips && corner == -1) continue;
    if (corner < 0 || static_cast<std::uint64_t>(corner) >= faces.vertices)
      throw std::invalid_argument("vertex " + std::to_string(corner) + " is named, but there are " +
                                  std::to_string(faces.vertices) + ", counted from 0");
  }
  const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {
    faces.triangles.push_back({static_cast<std::uint32_t>(corners[a]),
                               static_cast<std::uint32_t>(corners[b]),
                               static_cast<std::uint32_t>(corners[c])});
  };
  std::size_t begin = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (faces.strips && corners[i] == -1) begin = i + 1;
    if (i < begin + 2) continue;
    if (!faces.strips) {
      add(begin, i - 1, i);  // a fan
    } else if ((i - begin) % 2 == 0) {
      add(i - 2, i - 1, i);
    } else {
      add(i - 1, i - 2, i);
    }
  }
}

// Asks for the lists of corners, if the element has them.
void ask_for_corners(const Cursor& file, Element& element, Faces& faces) {
  faces.strips = element.name == "tristrips";
  for (Column& property : element.properties) {
    if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
    if (property.length == nullptr || property.type->is_float)
      file.fail(
          element.text() + ": " + std::string(property.name) + " is not a list of whole numbers",
          "write it as `property list uchar int vertex_indices`");
    property.put_list = [&faces](std::span<const std::int64_t> corners) {
      add_triangles(corners, faces);
    };
    return;
  }
}

// Asks for all that makes points Gaussians. False unless the element has it.
bool ask_for_splat(Element& element, SplatColumns& into) {
  return ask_for<3>({"scale_0", "scale_1", "scale_2"}, element, into.log_scales) &&
         ask_for<2>({"rot_0", "opacity"}, element, into.heads) &&
         ask_for<3>({"rot_1", "rot_2", "rot_3"}, element, into.rotations);
}

detail::Order order_of(std::string_view encoding) {
  if (encoding == "ascii") return std::nullopt;
  return encoding == "binary_big_endian" ? std::endian::big : std::endian::little;
}

PointFile parse(std::span<const std::byte> bytes, std::string_view name, bool as_splat) {
  Cursor file(bytes, name);
  PlyHeader header = read_ply_header(file);
  const auto is_vertex = [](const Element& element) { return element.name == "vertex"; };
  const auto vertex = std::find_if(header.elements.begin(), header.elements.end(), is_vertex);
  if (std::count_if(header.elements.begin(), header.elements.end(), is_vertex) != 1)
    file.fail("the header does not declare one element vertex", "give a file that holds points");

  PointFile cloud;
  cloud.encoding = header.encoding;
  Faces faces{.vertices = vertex->rows};
  std::vector<Vec3> viewpoints;
  for (Element& element : header.elements) {
    if (is_vertex(element)) {
      if (!ask_for<3>({"x", "y", "z"}, element, cloud.points))
        file.fail("element vertex does not have one x, one y and one z that are no lists",
                  "give a file that holds points");
      if (as_splat && !ask_for_splat(element, cloud.splat.emplace()))
        file.fail("its points have no opacity, scale_0 to scale_2 and rot_0 to rot_3",
                  "give a splat; points and meshes are opened by ply: and map:");
      if (!as_splat) ask_for<3>({"nx", "ny", "nz"}, element, cloud.normals);
      ask_for_colours(as_splat, element, cloud.colours);
      for (const Column& property : element.properties)
        cloud.fields.push_back(
            {std::string(property.name),
             (property.length != nullptr ? "list of " : "") + std::string(property.type->name)});
    } else if (element.name == "face" || element.name == "tristrips") {
      ask_for_corners(file, element, faces);
    } else if (element.name == "camera") {
      ask_for<3>({"view_px", "view_py", "view_pz"}, element, viewpoints);
    }
    detail::read_rows(file, element.properties, element.rows, order_of(header.encoding),
                      "rows of " + element.text());
  }
  cloud.triangles = std::move(faces.triangles);
  if (!viewpoints.empty()) cloud.viewpoint = viewpoints.front();
  if (cloud.viewpoint && !cloud.viewpoint->allFinite())
    file.fail("the camera's view_px, view_py, view_pz are not finite", "correct them");
  cloud.width = cloud.points.size();
  cloud.non_finite = detail::count_non_finite(cloud.points);
  cloud.bytes_unread = file.left_after_blanks();
  return cloud;
}

}  // namespace

PointFile parse_ply(std::span<const std::byte> bytes, std::string_view name) {
  return parse(bytes, name, false);
}

PointFile parse_splat(std::span<const std::byte> bytes, std::string_view name) {
  return parse(bytes, name, true);
}

bool holds_splat(const std::filesystem::path& path) {
  constexpr std::size_t longest_header = 65536;  // [B] that is looked at
  std::string text(longest_header, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  if (is_gltf(path)) return text.find("KHR_gaussian_splatting") != std::string::npos;
  const std::size_t end = text.find("end_header");
  try {
    if (end == std::string::npos) return false;
    text.resize(text.find('\n', end));
    Cursor cursor(std::as_bytes(std::span(text)), path.string());
    SplatColumns columns;
    PlyHeader header = read_ply_header(cursor);
    return std::any_of(header.elements.begin(), header.elements.end(), [&](Element& element) {
      return element.name == "vertex" && ask_for_splat(element, columns);
    });
  } catch (const Error&) {
    return false;
  }
}

}  // namespace palpate
