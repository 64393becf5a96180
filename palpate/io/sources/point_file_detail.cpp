// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/point_file_detail.hpp"

#include <charconv>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <system_error>

#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {

PointFile read_by(PointFile (*parse)(std::span<const std::byte> bytes, std::string_view name),
                  const std::filesystem::path& path, std::uintmax_t largest) {
  return parse(read_file(path, largest), path.string());
}

void SplatColumns::add(const Vec3& logs, double opacity, const Eigen::Quaterniond& turn) {
  log_scales.push_back(logs);
  heads.emplace_back(turn.w(), std::log(opacity / (1.0 - opacity)), 0.0);
  rotations.emplace_back(turn.vec());
}

namespace detail {
namespace {

constexpr std::string_view blanks = " \t\r\n\v\f";

// The whole token as a number of that type; none if it is no number in range.
template <class T>
std::optional<T> number_in(std::string_view token) noexcept {
  T value = 0;
  const char* const end = token.data() + token.size();
  const auto [stop, error] = std::from_chars(token.data(), end, value);
  return error == std::errc{} && stop == end ? std::optional(value) : std::nullopt;
}

// A value as text; one that is not needed and is no number is 0.
double value_of(const Cursor& file, const Column& column, std::string_view token) {
  const std::optional<double> number = to_number(token);
  if (!number && column.is_needed)
    file.fail_in_line(std::string(column.name) + " is " + quoted(token) + ", not a number",
                      "correct the line; nan marks a hole");
  const double value = number.value_or(0.0);
  if (!column.is_bits) return value;
  const bool fits = std::abs(value) <= double{std::numeric_limits<float>::max()};
  return std::bit_cast<std::uint32_t>(fits ? static_cast<float>(value) : 0.0F);
}

void read_line(Cursor& file, std::span<const Column> columns, std::size_t row,
               std::string_view line, std::vector<std::int64_t>& list) {
  const auto next = [&] {
    const std::string_view token = next_token(line);
    if (token.empty())
      file.fail_in_line("has too few values", "complete the line, or correct the header");
    return token;
  };
  for (const Column& column : columns) {
    if (column.length == nullptr) {
      const std::string_view first = next();
      if (column.put) column.put(row, value_of(file, column, first));
      for (std::size_t i = 1; i < column.count; ++i) next();
      continue;
    }
    const std::string_view token = next();
    const auto length = number_in<std::uint64_t>(token);
    if (!length) file.fail_in_line("a list's length is " + quoted(token), "correct the line");
    list.clear();
    for (std::uint64_t k = 0; k < *length; ++k) {
      const std::string_view text = next();
      if (!column.put_list) continue;
      const auto value = number_in<std::int64_t>(text);
      if (!value)
        file.fail_in_line(
            "one of " + std::string(column.name) + " is " + quoted(text) + ", not a whole number",
            "correct the line");
      list.push_back(*value);
    }
    if (column.put_list) column.put_list(list);
  }
  if (!next_token(line).empty())
    file.fail_in_line("has too many values", "shorten the line, or correct the header");
}

// A row in which lists are.
void read_lists(Cursor& file, std::span<const Column> columns, std::size_t row, std::endian order,
                const std::string& noun, std::vector<std::int64_t>& list) {
  for (const Column& column : columns) {
    if (file.left() < column.bytes()) file.fail_at_offset("ends within the " + noun, cut_short);
    const std::byte* const value = file.take(column.bytes());
    if (column.length == nullptr) {
      if (column.put) take_column(column, value, 0, 1, order, row);
      continue;
    }
    const auto length = static_cast<std::int64_t>(column.length->value(value, order));
    const std::size_t size = column.type->size;
    if (length < 0 || static_cast<std::uint64_t>(length) > file.left() / size)
      file.fail_at_offset("a list promises " + std::to_string(length) + " values, but " +
                              std::to_string(file.left()) + " bytes are left",
                          cut_short);
    const auto count = static_cast<std::size_t>(length);
    const std::byte* const values = file.take(count * size);
    if (!column.put_list) continue;
    list.clear();
    for (std::size_t k = 0; k < count; ++k)
      list.push_back(static_cast<std::int64_t>(column.type->value(values + k * size, order)));
    column.put_list(list);
  }
}

}  // namespace

std::vector<std::byte> read_beside(const std::filesystem::path& folder, const std::string& named,
                                   const std::string& of) {
  if (std::filesystem::path(named).is_absolute() || named.find("..") != std::string::npos ||
      named.find(':') != std::string::npos)
    throw Error(of, "its data " + detail::quoted(named) + " are not in a file beside it",
                "put them beside it, or write all as one file");
  return read_file(folder / named, largest_file);
}

std::string_view next_token(std::string_view& rest) noexcept {
  const auto is_blank = [](char c) { return blanks.find(c) != std::string_view::npos; };
  const char* const begin = std::find_if_not(rest.data(), rest.data() + rest.size(), is_blank);
  const char* const end = std::find_if(begin, rest.data() + rest.size(), is_blank);
  const std::string_view token(begin, static_cast<std::size_t>(end - begin));
  rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
  return token;
}

std::optional<double> to_number(std::string_view token) noexcept {
  if (token.size() > 1 && token[0] == '+' && token[1] != '-')
    token.remove_prefix(1);  // which from_chars does not know
  return number_in<double>(token);
}

std::vector<double> to_numbers(std::string list, std::size_t count) {
  for (char& c : list)
    if (c == ',' || c == '(' || c == ')') c = ' ';
  std::string_view rest = list;
  std::vector<double> numbers;
  for (auto token = next_token(rest); !token.empty(); token = next_token(rest)) {
    const auto number = to_number(token);
    if (!number || !std::isfinite(*number)) return {};
    numbers.push_back(*number);
  }
  return numbers.size() == count ? numbers : std::vector<double>{};
}

std::optional<std::size_t> to_count(std::string_view token) noexcept {
  return number_in<std::size_t>(token);
}

std::string quoted(std::string_view piece) {
  constexpr std::size_t longest = 40;
  std::string text = "\"";
  for (const char c : piece.substr(0, longest)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + (piece.size() > longest ? "...\"" : "\"");
}

std::uint8_t colour_byte(double share) noexcept {
  return static_cast<std::uint8_t>(share > 0.0 ? std::lround(255.0 * std::min(share, 1.0)) : 0);
}

std::size_t count_non_finite(std::span<const Vec3> points) noexcept {
  return static_cast<std::size_t>(std::count_if(
      points.begin(), points.end(), [](const Vec3& point) { return !point.allFinite(); }));
}

std::size_t Cursor::left_after_blanks() const noexcept {
  const auto rest = bytes_.subspan(at_);
  const auto first = std::find_if(rest.begin(), rest.end(), [](std::byte b) {
    return blanks.find(static_cast<char>(b)) == std::string_view::npos;
  });
  return static_cast<std::size_t>(rest.end() - first);
}

std::optional<std::string_view> Cursor::next_line() noexcept {
  if (left() == 0) return std::nullopt;
  const std::string_view rest(reinterpret_cast<const char*>(bytes_.data()) + at_, left());
  std::string_view line = rest.substr(0, rest.find('\n'));
  at_ += std::min(line.size() + 1, rest.size());
  ++line_;
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

std::optional<std::string_view> Cursor::next_full_line() noexcept {
  auto line = next_line();
  while (line && line->find_first_not_of(blanks) == std::string_view::npos) line = next_line();
  return line;
}

const std::byte* Cursor::take(std::size_t size) noexcept {
  const std::byte* const taken = bytes_.data() + at_;
  at_ += size;
  return taken;
}

void Cursor::fail_in_line(const std::string& reason, const std::string& remedy) const {
  throw Error(name_, "line " + std::to_string(line_) + ": " + reason, remedy);
}

void Cursor::fail_at_offset(const std::string& reason, const std::string& remedy) const {
  throw Error(name_, "byte " + std::to_string(at_) + ": " + reason, remedy);
}

void Cursor::fail(const std::string& reason, const std::string& remedy) const {
  throw Error(name_, reason, remedy);
}

void take_column(const Column& column, const std::byte* first, std::size_t stride, std::size_t rows,
                 std::endian order, std::size_t first_row) {
  for (std::size_t row = first_row; row < first_row + rows; ++row, first += stride)
    column.put(row, column.type->value(first, order));
}

void ask_for(Column& column, std::vector<Vec3>& points, std::size_t axis) {
  column.prepare = [&points](std::size_t rows) { points.resize(rows); };
  column.put = [&points, axis](std::size_t row, double value) {
    points[row][static_cast<Eigen::Index>(axis)] = value;
  };
}

void prepare(std::span<const Column> columns, std::size_t rows) {
  for (const Column& column : columns)
    if (column.prepare) column.prepare(rows);
}

void read_rows(Cursor& file, std::span<const Column> columns, std::size_t rows, Order order,
               const std::string& noun) {
  // [bytes] of a row; in text a digit and what separates it. No sum of columns overflows 64 bits,
  // which a browser's std::size_t does not have.
  std::uint64_t least = 0;
  bool has_lists = false;
  for (const Column& column : columns) {
    least += order ? column.bytes() : 2 * column.count;
    has_lists |= column.length != nullptr;
  }
  if (least == 0) return;  // rows of nothing take no space, whatever their number
  // The last line of a text may lack its end.
  if (rows > (file.left() + (order ? 0 : 1)) / least)
    file.fail_at_offset("the header promises " + std::to_string(rows) + " " + noun +
                            ", more than the " + std::to_string(file.left()) +
                            " bytes from here can hold",
                        cut_short);
  prepare(columns, rows);
  if (order && !has_lists) {
    const auto stride = static_cast<std::size_t>(least);
    const std::byte* first = file.take(rows * stride);
    for (const Column& column : columns) {
      if (column.put) take_column(column, first, stride, rows, *order);
      first += column.bytes();
    }
    return;
  }
  std::vector<std::int64_t> list;
  try {
    for (std::size_t row = 0; row < rows; ++row) {
      if (order) {
        read_lists(file, columns, row, *order, noun, list);
        continue;
      }
      const auto line = file.next_full_line();
      if (!line)
        file.fail("ends after " + std::to_string(row) + " of " + std::to_string(rows) + " " + noun,
                  cut_short);
      read_line(file, columns, row, *line, list);
    }
  } catch (const std::invalid_argument& wrong) {
    const std::string reason = noun + ": " + wrong.what();
    if (order) file.fail_at_offset(reason, "write the file again, or remove its faces");
    file.fail_in_line(reason, "correct the line");
  }
}

}  // namespace detail
}  // namespace palpate
