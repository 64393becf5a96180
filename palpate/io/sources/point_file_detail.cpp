// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/point_file_detail.hpp"

#include <charconv>
#include <system_error>

#include "palpate/kernel/core/error.hpp"

namespace palpate::detail {
namespace {

constexpr std::string_view blanks = " \t\r\n\v\f";

// The whole token as a number of that type; none if it is no number in range.
template <class T>
std::optional<T> to_whole(std::string_view token) noexcept {
  T value = 0;
  const char* const end = token.data() + token.size();
  const auto [stop, error] = std::from_chars(token.data(), end, value);
  return error == std::errc{} && stop == end ? std::optional(value) : std::nullopt;
}

}  // namespace

std::string_view name_of(Scalar type) noexcept {
  constexpr std::array<std::string_view, 10> names{"int8",    "uint8",  "int16", "uint16",
                                                   "int32",   "uint32", "int64", "uint64",
                                                   "float32", "float64"};
  return names[static_cast<std::size_t>(type)];
}

void load_column(const std::byte* first, std::size_t stride, Scalar type, std::endian order,
                 std::span<Vec3> points, int axis) {
  visit_scalar(type, [&](auto value) {
    for (Vec3& point : points) {
      point[axis] = static_cast<double>(load<decltype(value)>(first, order));
      first += stride;
    }
  });
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
  if (token.size() > 1 && token[0] == '+' && token[1] != '-') {
    token.remove_prefix(1);  // which from_chars does not know
  }
  double value = 0.0;
  const char* const end = token.data() + token.size();
  const auto [stop, error] = std::from_chars(token.data(), end, value);
  return error == std::errc{} && stop == end ? std::optional(value) : std::nullopt;
}

std::optional<std::uint64_t> to_count(std::string_view token) noexcept {
  return to_whole<std::uint64_t>(token);
}

std::optional<std::int64_t> to_index(std::string_view token) noexcept {
  return to_whole<std::int64_t>(token);
}

std::string quoted(std::string_view piece) {
  constexpr std::size_t longest = 40;
  std::string text = "\"";
  for (const char c : piece.substr(0, longest)) {
    text += c >= ' ' && c <= '~' ? c : '?';
  }
  return text + (piece.size() > longest ? "...\"" : "\"");
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
  if (left() == 0) {
    return std::nullopt;
  }
  const std::string_view rest(reinterpret_cast<const char*>(bytes_.data()) + at_, left());
  std::string_view line = rest.substr(0, rest.find('\n'));
  at_ += std::min(line.size() + 1, rest.size());
  ++line_;
  if (line.ends_with('\r')) {
    line.remove_suffix(1);
  }
  return line;
}

std::optional<std::string_view> Cursor::next_full_line() noexcept {
  auto line = next_line();
  while (line && line->find_first_not_of(blanks) == std::string_view::npos) {
    line = next_line();
  }
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

}  // namespace palpate::detail
