// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <fstream>

#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

using detail::Cursor;
using detail::cut_short;
using detail::Scalar;

constexpr const char* not_ply = "check that this is a PLY file";
constexpr const char* correct_line = "correct the line";

struct Property {
  std::string_view name;
  Scalar type;
  std::optional<Scalar> length;  // the type of a list's length; none if this is no list
  // Where its values go; a property that is not wanted is checked and passed over.
  std::vector<Vec3>* into = nullptr;
  int axis = 0;
  std::vector<std::uint8_t>* colours = nullptr;  // with `axis` as the channel
  bool corners = false;                          // a list of vertices

  [[nodiscard]] std::size_t least_bytes() const { return detail::size_of(length.value_or(type)); }
};

struct Element {
  std::string_view name;
  std::uint64_t rows = 0;
  std::vector<Property> properties;

  [[nodiscard]] std::string text() const { return "element " + detail::quoted(name); }
};

// Triangles, made of the lists of an element's rows.
struct Faces {
  std::uint64_t vertices = 0;  // as many as the header declares
  bool strips = false;         // every three neighbours of a list are a triangle; -1 begins anew
  std::vector<std::array<std::uint32_t, 3>> triangles{};
  std::vector<std::int64_t> corners{};  // the list being read
};

struct PlyHeader {
  std::string_view encoding;
  std::vector<Element> elements;
};

Scalar type_of(const Cursor& file, std::string_view name) {
  constexpr std::array<std::pair<std::string_view, Scalar>, 16> types{
      {{"char", Scalar::int8},
       {"int8", Scalar::int8},
       {"uchar", Scalar::uint8},
       {"uint8", Scalar::uint8},
       {"short", Scalar::int16},
       {"int16", Scalar::int16},
       {"ushort", Scalar::uint16},
       {"uint16", Scalar::uint16},
       {"int", Scalar::int32},
       {"int32", Scalar::int32},
       {"uint", Scalar::uint32},
       {"uint32", Scalar::uint32},
       {"float", Scalar::float32},
       {"float32", Scalar::float32},
       {"double", Scalar::float64},
       {"float64", Scalar::float64}}};
  const auto* const found = std::find_if(types.begin(), types.end(),
                                         [&](const auto& known) { return known.first == name; });
  if (found == types.end())
    file.fail_in_line(detail::quoted(name) + " is not a type of PLY",
                      "types are char, uchar, short, ushort, int, uint, float and double");
  return found->second;
}

Property read_property(const Cursor& file, std::string_view rest) {
  Property property{};
  std::string_view type = detail::next_token(rest);
  if (type == "list") {
    property.length = type_of(file, detail::next_token(rest));
    if (*property.length == Scalar::float32 || *property.length == Scalar::float64)
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

// Asks for some properties as coordinates. False unless the element has each of the names once,
// and not as a list.
template <std::size_t N>
bool ask_for(const std::array<std::string_view, N>& names, Element& element,
             std::vector<Vec3>& into) {
  std::array<Property*, N> found{};
  for (std::size_t axis = 0; axis < N; ++axis) {
    for (Property& property : element.properties) {
      if (property.name != names[axis]) continue;
      if (found[axis] != nullptr || property.length) return false;
      found[axis] = &property;
    }
    if (found[axis] == nullptr) return false;
  }
  for (std::size_t axis = 0; axis < N; ++axis) {
    found[axis]->into = &into;
    found[axis]->axis = static_cast<int>(axis);
  }
  return true;
}

// Asks for the points' colours, if there is one red, one green and one blue, of bytes or floats.
void ask_for_colours(Element& element, std::vector<std::uint8_t>& into) {
  constexpr std::array<std::string_view, 3> names{"red", "green", "blue"};
  std::array<Property*, 3> found{};
  for (Property& property : element.properties) {
    const auto* const name = std::find(names.begin(), names.end(), property.name);
    if (name == names.end()) continue;
    Property*& place = found[static_cast<std::size_t>(name - names.begin())];
    const bool is_known = property.type == Scalar::uint8 || property.type == Scalar::float32 ||
                          property.type == Scalar::float64;
    if (place != nullptr || property.length || !is_known) return;
    place = &property;
  }
  if (std::find(found.begin(), found.end(), nullptr) != found.end()) return;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    found[channel]->colours = &into;
    found[channel]->axis = static_cast<int>(channel);
  }
}

// Puts a colour's channel, a byte or a float from 0 to 1, where it goes. Nothing depends on a
// colour: one that is no number is black.
void set_colour(const Property& property, std::size_t row, double value) {
  const double scaled = property.type == Scalar::uint8 ? value : 255.0 * value;
  (*property.colours)[3 * row + static_cast<std::size_t>(property.axis)] =
      static_cast<std::uint8_t>(scaled > 0.0 ? std::lround(std::min(scaled, 255.0)) : 0);
}

void load_colour(const Property& property, std::size_t row, const std::byte* value,
                 std::endian order) {
  set_colour(property, row, detail::visit_scalar(property.type, [&](auto kind) {
               return static_cast<double>(detail::load<decltype(kind)>(value, order));
             }));
}

// Asks for the lists of corners, if the element has them.
void ask_for_corners(const Cursor& file, Element& element) {
  for (Property& property : element.properties) {
    if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
    if (!property.length || property.type == Scalar::float32 || property.type == Scalar::float64)
      file.fail(
          element.text() + ": " + std::string(property.name) + " is not a list of whole numbers",
          "write it as `property list uchar int vertex_indices`");
    property.corners = true;
    return;
  }
}

// Calls `fail(reason)`, which throws, where a corner is no vertex.
template <class Fail>
void add_triangles(const Element& element, Faces& faces, const Fail& fail) {
  const std::vector<std::int64_t>& corners = faces.corners;
  for (const std::int64_t corner : corners) {
    if (faces.strips && corner == -1) continue;
    if (corner < 0 || static_cast<std::uint64_t>(corner) >= faces.vertices)
      fail(element.text() + " names vertex " + std::to_string(corner) + ", but there are " +
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

[[noreturn]] void fail_promise(const Cursor& file, const Element& element) {
  file.fail_at_offset(element.text() + " promises " + std::to_string(element.rows) +
                          " rows, more than the " + std::to_string(file.left()) +
                          " bytes from here can hold",
                      cut_short);
}

void read_ascii_row(Cursor& file, const Element& element, std::size_t row, Faces& faces) {
  auto line = file.next_full_line();
  if (!line) file.fail("ends within " + element.text(), cut_short);
  const auto next = [&] {
    const std::string_view token = detail::next_token(*line);
    if (token.empty())
      file.fail_in_line("has too few values for " + element.text(),
                        "complete the line, or correct the header");
    return token;
  };
  for (const Property& property : element.properties) {
    const std::string_view token = next();
    if (property.length) {
      const auto length = detail::to_count(token);
      if (!length) file.fail_in_line("a list's length is " + detail::quoted(token), correct_line);
      faces.corners.clear();
      for (std::uint64_t k = 0; k < *length; ++k) {
        const std::string_view value = next();
        if (!property.corners) continue;
        const auto corner = detail::to_index(value);
        if (!corner)
          file.fail_in_line("a vertex of " + element.text() + " is " + detail::quoted(value) +
                                ", not a whole number",
                            correct_line);
        faces.corners.push_back(*corner);
      }
      if (property.corners)
        add_triangles(element, faces,
                      [&](const std::string& reason) { file.fail_in_line(reason, correct_line); });
    } else if (property.into != nullptr) {
      const auto number = detail::to_number(token);
      if (!number)
        file.fail_in_line(
            std::string(property.name) + " is " + detail::quoted(token) + ", not a number",
            correct_line);
      (*property.into)[row][property.axis] = *number;
    } else if (property.colours != nullptr) {
      set_colour(property, row, detail::to_number(token).value_or(0.0));
    }
  }
  if (!detail::next_token(*line).empty())
    file.fail_in_line("has too many values for " + element.text(),
                      "shorten the line, or correct the header");
}

void read_binary_row(Cursor& file, const Element& element, std::endian order, std::size_t row,
                     Faces& faces) {
  const auto integer = [order](Scalar type, const std::byte* value) {
    return detail::visit_scalar(type, [&](auto kind) {
      return static_cast<std::int64_t>(detail::load<decltype(kind)>(value, order));
    });
  };
  for (const Property& property : element.properties) {
    if (file.left() < property.least_bytes())
      file.fail_at_offset("ends within " + element.text(), cut_short);
    const std::byte* const value = file.take(property.least_bytes());
    if (property.length) {
      const std::int64_t length = integer(*property.length, value);
      const std::size_t size = detail::size_of(property.type);
      if (length < 0 || static_cast<std::uint64_t>(length) > file.left() / size)
        file.fail_at_offset("a list of " + element.text() + " promises " + std::to_string(length) +
                                " values, but " + std::to_string(file.left()) + " bytes are left",
                            cut_short);
      const auto count = static_cast<std::size_t>(length);
      const std::byte* const list = file.take(count * size);
      if (!property.corners) continue;
      faces.corners.clear();
      for (std::size_t k = 0; k < count; ++k)
        faces.corners.push_back(integer(property.type, list + k * size));
      add_triangles(element, faces, [&](const std::string& reason) {
        file.fail_at_offset(reason, "write the file again, or remove its faces");
      });
    } else if (property.into != nullptr) {
      detail::load_column(value, 0, property.type, order, {&(*property.into)[row], 1},
                          property.axis);
    } else if (property.colours != nullptr) {
      load_colour(property, row, value, order);
    }
  }
}

// Reads all rows of an element.
void read_element(Cursor& file, const Element& element, std::string_view encoding, Faces& faces) {
  const std::vector<Property>& properties = element.properties;
  if (properties.empty()) {
    return;  // its rows take no space, whatever their number
  }
  const bool ascii = encoding == "ascii";
  const std::endian order =
      encoding == "binary_big_endian" ? std::endian::big : std::endian::little;
  std::size_t least_bytes = 0;
  bool has_lists = false;
  for (const Property& property : properties) {
    least_bytes += ascii ? 2 : property.least_bytes();  // in ascii a digit and what separates it
    has_lists |= property.length.has_value();
  }
  // The last line of an ascii file may lack its end.
  if (element.rows > (file.left() + (ascii ? 1 : 0)) / least_bytes) fail_promise(file, element);
  for (const Property& property : properties) {
    if (property.into != nullptr) property.into->resize(element.rows);
    if (property.colours != nullptr) property.colours->resize(3 * element.rows);
  }
  if (!ascii && !has_lists) {
    const std::byte* column = file.take(element.rows * least_bytes);
    for (const Property& property : properties) {
      if (property.into != nullptr)
        detail::load_column(column, least_bytes, property.type, order, *property.into,
                            property.axis);
      if (property.colours != nullptr) {
        for (std::size_t row = 0; row < element.rows; ++row)
          load_colour(property, row, column + row * least_bytes, order);
      }
      column += property.least_bytes();
    }
    return;
  }
  for (std::size_t row = 0; row < element.rows; ++row) {
    if (ascii) {
      read_ascii_row(file, element, row, faces);
    } else {
      read_binary_row(file, element, order, row, faces);
    }
  }
}

// Asks for all that makes points Gaussians. False unless the element has it.
bool ask_for_splat(Element& element, SplatColumns& into) {
  return ask_for<3>({"scale_0", "scale_1", "scale_2"}, element, into.log_scales) &&
         ask_for<2>({"rot_0", "opacity"}, element, into.heads) &&
         ask_for<3>({"rot_1", "rot_2", "rot_3"}, element, into.rotations);
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
      if (!as_splat) {
        ask_for<3>({"nx", "ny", "nz"}, element, cloud.normals);
        ask_for_colours(element, cloud.colours);
      }
      for (const Property& property : element.properties)
        cloud.fields.push_back(
            {std::string(property.name),
             (property.length ? "list of " : "") + std::string(name_of(property.type))});
    } else if (element.name == "face" || element.name == "tristrips") {
      ask_for_corners(file, element);
      faces.strips = element.name == "tristrips";
    } else if (element.name == "camera") {
      ask_for<3>({"view_px", "view_py", "view_pz"}, element, viewpoints);
    }
    read_element(file, element, header.encoding, faces);
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

PointFile read_ply(const std::filesystem::path& path) {
  return parse_ply(read_file(path, detail::largest_file), path.string());
}

PointFile parse_splat(std::span<const std::byte> bytes, std::string_view name) {
  return parse(bytes, name, true);
}

PointFile read_splat(const std::filesystem::path& path) {
  return parse_splat(read_file(path, detail::largest_file), path.string());
}

bool holds_splat(const std::filesystem::path& path) {
  constexpr std::size_t longest_header = 16384;  // [B] that is looked at
  std::string text(longest_header, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
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
