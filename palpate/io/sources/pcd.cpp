// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <map>

#include <lzf.h>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

using detail::Column;
using detail::Cursor;
using detail::cut_short;
using detail::Scalar;

constexpr const char* not_pcd = "check that this is a PCD file";
constexpr const char* correct_header = "correct the header";
constexpr const char* write_anew = "write the file again";

// The values of each line of the header, by keyword.
using PcdHeader = std::map<std::string_view, std::vector<std::string_view>>;

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

std::optional<std::size_t> count_of(const Cursor& file, const PcdHeader& header,
                                    std::string_view keyword) {
  const auto value = value_of(file, header, keyword);
  if (!value) return std::nullopt;
  const auto count = detail::to_count(*value);
  if (!count)
    file.fail(std::string(keyword) + " is " + detail::quoted(*value) + ", not a whole number",
              correct_header);
  return count;
}

const Scalar* type_of(const Cursor& file, std::string_view type, std::string_view size) {
  const std::string wanted = std::string(type) + std::string(size);
  const Scalar* found =
      detail::find_scalar([&](const Scalar& known) { return known.pcd == wanted; });
  if (found == nullptr)
    file.fail(
        "no field can have TYPE " + detail::quoted(type) + " and SIZE " + detail::quoted(size),
        "types are I and U of 1, 2, 4, 8 bytes, and F of 4, 8");
  return found;
}

// Puts a packed colour, 0xAARRGGBB, where it goes; one that is no number is black.
void set_colour(std::vector<std::uint8_t>& colours, std::size_t point, double value) {
  const auto packed = static_cast<std::int64_t>(std::abs(value) < 0x1p53 ? value : 0.0);
  for (std::size_t channel = 0; channel < 3; ++channel)
    colours[3 * point + channel] = static_cast<std::uint8_t>(packed >> (16 - 8 * channel));
}

// The columns, with what is read of them going into `cloud`.
std::vector<Column> columns_of(const Cursor& file, const PcdHeader& header, PointFile& cloud) {
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
    constexpr std::size_t largest_count = 1'000'000;  // keeps all products below in 64 bits
    const auto count = detail::to_count(counts[i]);
    if (!count || *count == 0 || *count > largest_count)
      file.fail(
          "COUNT " + detail::quoted(counts[i]) + " is not in 1.." + std::to_string(largest_count),
          correct_header);
    const Scalar* type = type_of(file, types[i], sizes[i]);
    columns.push_back({.name = fields->second[i], .type = type, .count = *count});
    cloud.fields.push_back(
        {std::string(columns.back().name), std::string(type->name), columns.back().count});
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string name(1, "xyz"[axis]);
    std::size_t found = 0;
    for (Column& column : columns) {
      if (column.name != name) continue;
      detail::ask_for(column, cloud.points, axis);
      found += column.count;
    }
    if (found != 1)
      file.fail("FIELDS must name " + name + " once, with COUNT 1",
                "give a file whose points have the fields x, y and z");
  }
  // PCL packs a colour into 4 bytes and declares them as a float or a whole number.
  const auto colour = std::find_if(columns.begin(), columns.end(), [](const Column& column) {
    return (column.name == "rgb" || column.name == "rgba") && column.count == 1 &&
           column.type->size == 4;
  });
  if (colour == columns.end()) return columns;
  colour->is_bits = colour->type->is_float;
  if (colour->is_bits) colour->type = type_of(file, "U", "4");
  colour->is_needed = false;
  colour->prepare = [&cloud](std::size_t rows) { cloud.colours.resize(3 * rows); };
  colour->put = [&cloud](std::size_t row, double value) { set_colour(cloud.colours, row, value); };
  return columns;
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
void read_compressed(Cursor& file, const std::vector<Column>& columns, std::size_t size) {
  const std::vector<std::byte> data = decompress(file);
  for (const bool has_padding : {true, false}) {
    const auto bytes_in_point = [&](const Column& column) {
      return column.name == "_" && !has_padding ? 0 : column.bytes();
    };
    std::uint64_t of_point = 0;  // [bytes]
    for (const Column& column : columns) of_point += bytes_in_point(column);
    if (data.size() % of_point != 0 || data.size() / of_point != size) continue;
    detail::prepare(columns, size);
    const std::byte* first = data.data();
    for (const Column& column : columns) {
      if (column.put) detail::take_column(column, first, column.bytes(), size, std::endian::little);
      first += size * bytes_in_point(column);
    }
    return;
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

  PointFile cloud;
  const std::vector<Column> columns = columns_of(file, header, cloud);
  read_extent(file, header, cloud);
  cloud.viewpoint = viewpoint_of(file, header);
  cloud.encoding = value_of(file, header, "DATA").value();
  const std::size_t size = cloud.width * cloud.height;
  if (cloud.encoding == "ascii")
    detail::read_rows(file, columns, size, {}, "points");
  else if (cloud.encoding == "binary")  // little endian: PCL writes what is in memory
    detail::read_rows(file, columns, size, std::endian::little, "points");
  else if (cloud.encoding == "binary_compressed")
    read_compressed(file, columns, size);
  else
    file.fail("DATA " + detail::quoted(cloud.encoding) + " is not known",
              "it can be ascii, binary or binary_compressed");
  cloud.non_finite = detail::count_non_finite(cloud.points);
  cloud.bytes_unread = file.left_after_blanks();
  return cloud;
}

}  // namespace palpate
