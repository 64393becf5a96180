// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include <lzf.h>

#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

using detail::Cursor;
using detail::cut_short;
using detail::Scalar;

constexpr const char* not_pcd = "check that this is a PCD file";
constexpr const char* correct_header = "correct the header";
constexpr const char* write_anew = "write the file again";

// The values of each line of the header, by keyword.
using PcdHeader = std::map<std::string_view, std::vector<std::string_view>>;

// What a column is read for.
enum class Use : std::uint8_t { x, y, z, colour, none };

struct Column {
  PointField field;
  Scalar type;
  Use use = Use::none;
  [[nodiscard]] std::size_t bytes() const { return detail::size_of(type) * field.count; }
  [[nodiscard]] bool is_padding() const { return field.name == "_"; }
};

// What is read of each point.
struct Values {
  Values(const std::vector<Column>& columns, std::size_t size) : points(size) {
    for (const Column& column : columns) {
      if (column.use == Use::colour) rgb.resize(3 * size);
    }
  }
  void set_colour(std::size_t point, std::uint32_t packed) {
    for (std::size_t channel = 0; channel < 3; ++channel)
      rgb[3 * point + channel] = static_cast<std::uint8_t>(packed >> (16 - 8 * channel));
  }
  // Takes a column whose values begin at `first`, each `stride` bytes behind the one before.
  void take(const Column& column, const std::byte* first, std::size_t stride) {
    if (column.use == Use::colour) {
      for (std::size_t k = 0; k < points.size(); ++k)
        set_colour(k, detail::load<std::uint32_t>(first + k * stride, std::endian::little));
    } else if (column.use != Use::none) {
      detail::load_column(first, stride, column.type, std::endian::little, points,
                          static_cast<int>(column.use));
    }
  }

  std::vector<Vec3> points;
  std::vector<std::uint8_t> rgb;  // 3 of each point; empty without a colour
};

std::string counted(std::uint64_t number, const std::string& noun) {
  return std::to_string(number) + " " + noun + (number == 1 ? "" : "s");
}

PcdHeader read_pcd_header(Cursor& file) {
  constexpr std::array<std::string_view, 10> keywords{"VERSION", "FIELDS", "SIZE",   "TYPE",
                                                      "COUNT",   "WIDTH",  "HEIGHT", "VIEWPOINT",
                                                      "POINTS",  "DATA"};
  PcdHeader header;
  while (const auto line = file.next_full_line()) {
    std::string_view rest = *line;
    std::string_view keyword = detail::next_token(rest);
    if (keyword.starts_with('#')) continue;
    if (keyword == "COLUMNS") {
      keyword = "FIELDS";  // its name before version 0.5
    }
    if (std::find(keywords.begin(), keywords.end(), keyword) == keywords.end())
      file.fail_in_line(detail::quoted(keyword) + " does not begin a line of a PCD header",
                        not_pcd);
    const auto [entry, is_new] = header.try_emplace(keyword);
    if (!is_new) file.fail_in_line(std::string(keyword) + " is given twice", "remove one of them");
    for (auto value = detail::next_token(rest); !value.empty(); value = detail::next_token(rest))
      entry->second.push_back(value);
    if (keyword == "DATA") return header;
  }
  file.fail("the header has no DATA line", not_pcd);
}

// The one value of a keyword; none if the header lacks it.
std::optional<std::string_view> value_of(const Cursor& file, const PcdHeader& header,
                                         std::string_view keyword) {
  const auto entry = header.find(keyword);
  if (entry == header.end()) return std::nullopt;
  if (entry->second.size() != 1)
    file.fail(std::string(keyword) + " has " + counted(entry->second.size(), "value") +
                  " where one belongs",
              correct_header);
  return entry->second.front();
}

std::optional<std::uint64_t> count_of(const Cursor& file, const PcdHeader& header,
                                      std::string_view keyword) {
  const auto value = value_of(file, header, keyword);
  if (!value) return std::nullopt;
  const auto count = detail::to_count(*value);
  if (!count)
    file.fail(std::string(keyword) + " is " + detail::quoted(*value) + ", not a whole number",
              correct_header);
  return count;
}

Scalar type_of(const Cursor& file, std::string_view type, std::string_view size) {
  constexpr std::array<std::pair<std::string_view, Scalar>, 10> types{{{"I1", Scalar::int8},
                                                                       {"U1", Scalar::uint8},
                                                                       {"I2", Scalar::int16},
                                                                       {"U2", Scalar::uint16},
                                                                       {"I4", Scalar::int32},
                                                                       {"U4", Scalar::uint32},
                                                                       {"I8", Scalar::int64},
                                                                       {"U8", Scalar::uint64},
                                                                       {"F4", Scalar::float32},
                                                                       {"F8", Scalar::float64}}};
  const std::string wanted = std::string(type) + std::string(size);
  const auto* const found = std::find_if(types.begin(), types.end(),
                                         [&](const auto& known) { return known.first == wanted; });
  if (found == types.end())
    file.fail(
        "no field can have TYPE " + detail::quoted(type) + " and SIZE " + detail::quoted(size),
        "types are I and U of 1, 2, 4, 8 bytes, and F of 4, 8");
  return found->second;
}

std::vector<Column> columns_of(const Cursor& file, const PcdHeader& header) {
  const auto fields = header.find("FIELDS");
  if (fields == header.end()) file.fail("the header has no FIELDS line", not_pcd);
  const std::size_t size = fields->second.size();
  const auto values = [&](std::string_view keyword, std::string_view otherwise) {
    const auto entry = header.find(keyword);
    if (entry == header.end()) return std::vector<std::string_view>(size, otherwise);
    if (entry->second.size() != size)
      file.fail(std::string(keyword) + " has " + counted(entry->second.size(), "value") + " for " +
                    counted(size, "field"),
                correct_header);
    return entry->second;
  };
  if (header.contains("SIZE") != header.contains("TYPE"))
    file.fail("the header has one of SIZE and TYPE without the other", correct_header);
  const auto sizes = values("SIZE", "4");  // the oldest files have floats only
  const auto types = values("TYPE", "F");
  const auto counts = values("COUNT", "1");

  std::vector<Column> columns;
  for (std::size_t i = 0; i < size; ++i) {
    constexpr std::uint64_t largest_count = 1'000'000;  // keeps all products below in 64 bits
    const auto count = detail::to_count(counts[i]);
    if (!count || *count == 0 || *count > largest_count)
      file.fail(
          "COUNT " + detail::quoted(counts[i]) + " is not in 1.." + std::to_string(largest_count),
          correct_header);
    const Scalar type = type_of(file, types[i], sizes[i]);
    columns.push_back({{std::string(fields->second[i]), std::string(detail::name_of(type)),
                        static_cast<std::size_t>(*count)},
                       type});
  }
  for (const Use use : {Use::x, Use::y, Use::z}) {
    const std::string name(1, "xyz"[static_cast<int>(use)]);
    std::size_t found = 0;
    for (Column& column : columns) {
      if (column.field.name != name) continue;
      column.use = use;
      found += column.field.count;
    }
    if (found != 1)
      file.fail("FIELDS must name " + name + " once, with COUNT 1",
                "give a file whose points have the fields x, y and z");
  }
  // PCL packs a colour into 4 bytes, 0xAARRGGBB, and declares them as a float or a whole number.
  const auto colour = std::find_if(columns.begin(), columns.end(), [](const Column& column) {
    return (column.field.name == "rgb" || column.field.name == "rgba") && column.field.count == 1 &&
           detail::size_of(column.type) == 4;
  });
  if (colour != columns.end()) colour->use = Use::colour;
  return columns;
}

// A packed colour written as text. Nothing depends on a colour: one that is no number is black.
std::uint32_t packed_colour(std::string_view token, Scalar type) {
  if (type == Scalar::float32) {
    const double number = detail::to_number(token).value_or(0.0);
    const bool fits = std::abs(number) <= double{std::numeric_limits<float>::max()};
    return std::bit_cast<std::uint32_t>(fits ? static_cast<float>(number) : 0.0F);
  }
  return static_cast<std::uint32_t>(detail::to_index(token).value_or(0));
}

// Sets the cloud's width and height. Old files have no WIDTH, some no POINTS.
void read_extent(const Cursor& file, const PcdHeader& header, PointFile& cloud) {
  const auto points = count_of(file, header, "POINTS");
  const auto width = count_of(file, header, "WIDTH");
  const auto height = count_of(file, header, "HEIGHT");
  if (!width && (!points || height.value_or(1) != 1))
    file.fail("the header has no WIDTH line", not_pcd);
  cloud.width = width ? *width : *points;
  cloud.height = height.value_or(1);
  if (cloud.height != 0 && cloud.width > std::numeric_limits<std::size_t>::max() / cloud.height)
    file.fail("WIDTH times HEIGHT is beyond all bounds", correct_header);
  if (points && *points != cloud.width * cloud.height)
    file.fail("WIDTH " + std::to_string(cloud.width) + " times HEIGHT " +
                  std::to_string(cloud.height) + " is not POINTS " + std::to_string(*points),
              correct_header);
}

std::optional<Vec3> viewpoint_of(const Cursor& file, const PcdHeader& header) {
  const auto entry = header.find("VIEWPOINT");
  if (entry == header.end()) return std::nullopt;
  std::vector<double> numbers;
  for (const std::string_view value : entry->second)
    numbers.push_back(detail::to_number(value).value_or(std::numeric_limits<double>::quiet_NaN()));
  if (numbers.size() != 7 || !std::all_of(numbers.begin(), numbers.end(),
                                          [](double value) { return std::isfinite(value); })) {
    file.fail("VIEWPOINT is not seven numbers",
              "give a position and a quaternion, or 0 0 0 1 0 0 0");
  }
  return Vec3(numbers[0], numbers[1], numbers[2]);
}

// The size of a point, if each column takes up `size(column)`.
template <class Size>
std::size_t size_of_point(const std::vector<Column>& columns, const Size& size) {
  return std::accumulate(columns.begin(), columns.end(), std::size_t{0},
                         [&](std::size_t sum, const Column& column) { return sum + size(column); });
}

[[noreturn]] void fail_promise(const Cursor& file, std::size_t points) {
  file.fail("the header promises " + counted(points, "point") + ", more than the " +
                counted(file.left(), "byte") + " after it can hold",
            cut_short);
}

Values read_ascii(Cursor& file, const std::vector<Column>& columns, std::size_t size) {
  const std::size_t needed =
      size_of_point(columns, [](const Column& column) { return column.field.count; });
  // A value and what separates it take two bytes at least; the last line may lack its end.
  if (size > (file.left() + 1) / (2 * needed)) fail_promise(file, size);
  Values read(columns, size);
  for (std::size_t k = 0; k < size; ++k) {
    auto line = file.next_full_line();
    if (!line)
      file.fail("ends after " + std::to_string(k) + " of " + counted(size, "point"), cut_short);
    std::size_t values = 0;
    const auto next = [&] {
      const std::string_view token = detail::next_token(*line);
      if (token.empty())
        file.fail_in_line(
            "has " + counted(values, "value") + " where the FIELDS need " + std::to_string(needed),
            "complete the line, or correct the header");
      ++values;
      return token;
    };
    for (const Column& column : columns) {
      const std::string_view token = next();
      if (column.use == Use::colour) {
        read.set_colour(k, packed_colour(token, column.type));
      } else if (column.use != Use::none) {
        const auto number = detail::to_number(token);
        if (!number)
          file.fail_in_line(column.field.name + " is " + detail::quoted(token) + ", not a number",
                            "correct the line; nan marks a hole");
        read.points[k][static_cast<int>(column.use)] = *number;
      }
      for (std::size_t i = 1; i < column.field.count; ++i) next();
    }
    if (!detail::next_token(*line).empty())
      file.fail_in_line("has more than the " + counted(needed, "value") + " of the FIELDS",
                        "shorten the line, or correct the header");
  }
  return read;
}

// Point after point, little endian: PCL writes what is in memory.
Values read_binary(Cursor& file, const std::vector<Column>& columns, std::size_t size) {
  const std::size_t bytes = size_of_point(columns, std::mem_fn(&Column::bytes));
  if (size > file.left() / bytes) fail_promise(file, size);
  Values read(columns, size);
  const std::byte* first = file.take(size * bytes);
  for (const Column& column : columns) {
    read.take(column, first, bytes);
    first += column.bytes();
  }
  return read;
}

// Two 32-bit sizes, then LZF.
std::vector<std::byte> decompress(Cursor& file) {
  if (file.left() < 8) file.fail_at_offset("ends before the compressed data", cut_short);
  const auto compressed = detail::load<std::uint32_t>(file.take(4), std::endian::little);
  const auto size = detail::load<std::uint32_t>(file.take(4), std::endian::little);
  if (compressed > file.left())
    file.fail_at_offset("promises " + counted(compressed, "byte") + " of compressed data, but " +
                            std::to_string(file.left()) + " are left",
                        cut_short);
  constexpr std::uint64_t best_ratio = 88;  // LZF: three bytes repeat at most 264
  if (size > compressed * best_ratio)
    file.fail_at_offset(
        counted(compressed, "byte") + " of compressed data cannot hold " + std::to_string(size),
        write_anew);
  std::vector<std::byte> data(size);
  // lzf_decompress() would read a byte even where there is none.
  if (compressed != 0 &&
      lzf_decompress(file.take(compressed), compressed, data.data(), size) != size) {
    file.fail_at_offset("the compressed data before this is corrupt", write_anew);
  }
  return data;
}

// All of the first field, then all of the second, and so on. PCL leaves padding out, others don't.
Values read_compressed(Cursor& file, const std::vector<Column>& columns, std::size_t size) {
  const std::vector<std::byte> data = decompress(file);
  for (const bool has_padding : {true, false}) {
    const auto bytes_in_point = [&](const Column& column) {
      return column.is_padding() && !has_padding ? 0 : column.bytes();
    };
    const std::size_t stride = size_of_point(columns, bytes_in_point);
    if (data.size() % stride != 0 || data.size() / stride != size) continue;
    Values read(columns, size);
    const std::byte* first = data.data();
    for (const Column& column : columns) {
      read.take(column, first, column.bytes());
      first += size * bytes_in_point(column);
    }
    return read;
  }
  file.fail("the header declares " + counted(size, "point") + ", which is not what the " +
                counted(data.size(), "byte") + " of compressed data hold",
            correct_header);
}

}  // namespace

PointFile parse_pcd(std::span<const std::byte> bytes, std::string_view name) {
  Cursor file(bytes, name);
  const PcdHeader header = read_pcd_header(file);
  const auto version = value_of(file, header, "VERSION");
  constexpr std::array<std::string_view, 6> versions{".5", "0.5", ".6", "0.6", ".7", "0.7"};
  if (version && std::find(versions.begin(), versions.end(), *version) == versions.end())
    file.fail("PCD version " + detail::quoted(*version) + " is not known",
              "write the file as version 0.7");
  const std::vector<Column> columns = columns_of(file, header);

  PointFile cloud;
  for (const Column& column : columns) cloud.fields.push_back(column.field);
  read_extent(file, header, cloud);
  cloud.viewpoint = viewpoint_of(file, header);
  cloud.encoding = value_of(file, header, "DATA").value();
  const std::size_t size = cloud.width * cloud.height;
  const bool is_binary = cloud.encoding == "binary";
  if (!is_binary && cloud.encoding != "ascii" && cloud.encoding != "binary_compressed")
    file.fail("DATA " + detail::quoted(cloud.encoding) + " is not known",
              "it can be ascii, binary or binary_compressed");
  Values read = is_binary                   ? read_binary(file, columns, size)
                : cloud.encoding == "ascii" ? read_ascii(file, columns, size)
                                            : read_compressed(file, columns, size);
  cloud.points = std::move(read.points);
  cloud.colours = std::move(read.rgb);
  cloud.non_finite = detail::count_non_finite(cloud.points);
  cloud.bytes_unread = file.left_after_blanks();
  return cloud;
}

PointFile read_pcd(const std::filesystem::path& path) {
  return parse_pcd(read_file(path, detail::largest_file), path.string());
}

}  // namespace palpate
