// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/kernel/core/patch.hpp"

/// Common parts of the readers of point files; not for use outside this room.
namespace palpate::detail {

/// The remedy for a file that ends too early.
inline constexpr const char* cut_short = "copy the file again, it may have been cut short";

/// Types of values in point files.
enum class Scalar : std::uint8_t {
  int8,
  uint8,
  int16,
  uint16,
  int32,
  uint32,
  int64,
  uint64,
  float32,
  float64
};

[[nodiscard]] std::string_view name_of(Scalar type) noexcept;

/// Calls `visit` with a value of the C++ type that `type` stands for.
template <class Visit>
decltype(auto) visit_scalar(Scalar type, const Visit& visit) {
  switch (type) {
    case Scalar::int8:
      return visit(std::int8_t{});
    case Scalar::uint8:
      return visit(std::uint8_t{});
    case Scalar::int16:
      return visit(std::int16_t{});
    case Scalar::uint16:
      return visit(std::uint16_t{});
    case Scalar::int32:
      return visit(std::int32_t{});
    case Scalar::uint32:
      return visit(std::uint32_t{});
    case Scalar::int64:
      return visit(std::int64_t{});
    case Scalar::uint64:
      return visit(std::uint64_t{});
    case Scalar::float32:
      return visit(float{});
    case Scalar::float64:
      break;
  }
  return visit(double{});
}

[[nodiscard]] inline std::size_t size_of(Scalar type) {
  return visit_scalar(type, [](auto value) { return sizeof value; });
}

template <class T>
T load(const std::byte* from, std::endian order) noexcept {
  std::array<std::byte, sizeof(T)> bytes;
  std::memcpy(bytes.data(), from, sizeof(T));
  if (order != std::endian::native) {
    std::reverse(bytes.begin(), bytes.end());
  }
  return std::bit_cast<T>(bytes);
}

/// Fills coordinate `axis` of `points` with values of `type`, the first at `first` and each
/// `stride` bytes behind the one before.
void load_column(const std::byte* first, std::size_t stride, Scalar type, std::endian order,
                 std::span<Vec3> points, int axis);

/// The next token of `rest`, which shrinks by it; empty if there is none. Blanks separate.
[[nodiscard]] std::string_view next_token(std::string_view& rest) noexcept;

/// The whole token as a number, "nan" and "inf" included; none if it is no number in range.
[[nodiscard]] std::optional<double> to_number(std::string_view token) noexcept;
[[nodiscard]] std::optional<std::uint64_t> to_count(std::string_view token) noexcept;
[[nodiscard]] std::optional<std::int64_t> to_index(std::string_view token) noexcept;

/// A piece of a file as a message can show it: in quotes, printable and short.
[[nodiscard]] std::string quoted(std::string_view piece);

[[nodiscard]] std::size_t count_non_finite(std::span<const Vec3> points) noexcept;

/// PCD and PLY files larger than this are not read.
inline constexpr std::uintmax_t largest_file = std::uintmax_t{1} << 32;

/// A parser's position in a file, and its errors.
class Cursor {
 public:
  Cursor(std::span<const std::byte> bytes, std::string_view name) : bytes_(bytes), name_(name) {}

  [[nodiscard]] std::size_t left() const noexcept { return bytes_.size() - at_; }
  /// How many bytes are left, not counting white space at their beginning.
  [[nodiscard]] std::size_t left_after_blanks() const noexcept;

  /// The next line without its end, LF or CRLF; none if no byte is left.
  [[nodiscard]] std::optional<std::string_view> next_line() noexcept;
  /// The next line that is not blank.
  [[nodiscard]] std::optional<std::string_view> next_full_line() noexcept;
  /// The next `size` bytes. @pre size <= left()
  const std::byte* take(std::size_t size) noexcept;

  /// @throws Error about the line read last.
  [[noreturn]] void fail_in_line(const std::string& reason, const std::string& remedy) const;
  /// @throws Error about the place reached.
  [[noreturn]] void fail_at_offset(const std::string& reason, const std::string& remedy) const;
  /// @throws Error about the file.
  [[noreturn]] void fail(const std::string& reason, const std::string& remedy) const;

 private:
  std::span<const std::byte> bytes_;
  std::string name_;
  std::size_t at_ = 0;
  std::size_t line_ = 0;
};

}  // namespace palpate::detail
