// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "palpate/kernel/core/patch.hpp"

/// Common parts of the readers of point files; not for use outside this room.
namespace palpate::detail {

/// The remedy for a file that ends too early.
inline constexpr const char* cut_short = "copy the file again, it may have been cut short";

template <class T>
T load(const std::byte* from, std::endian order) noexcept {
  std::array<std::byte, sizeof(T)> bytes;
  std::memcpy(bytes.data(), from, sizeof(T));
  if (order != std::endian::native) std::reverse(bytes.begin(), bytes.end());
  return std::bit_cast<T>(bytes);
}

/// A type of values in point files: its names here, in the header of a PCD (TYPE and SIZE) and in
/// that of a PLY, which also takes the first, and its number in glTF, 0: it has none.
struct Scalar {
  std::string_view name, pcd, ply;
  unsigned gltf;
  bool is_float;
  std::size_t size;  ///< [bytes]
  double (*value)(const std::byte* from, std::endian order) noexcept;

  template <class T>
  static constexpr Scalar of(std::string_view name, std::string_view pcd, std::string_view ply,
                             unsigned gltf) {
    return {name,
            pcd,
            ply,
            gltf,
            std::is_floating_point_v<T>,
            sizeof(T),
            [](const std::byte* from, std::endian order) noexcept {
              return static_cast<double>(load<T>(from, order));
            }};
  }
};
inline constexpr std::array scalars{Scalar::of<std::int8_t>("int8", "I1", "char", 5120),
                                    Scalar::of<std::uint8_t>("uint8", "U1", "uchar", 5121),
                                    Scalar::of<std::int16_t>("int16", "I2", "short", 5122),
                                    Scalar::of<std::uint16_t>("uint16", "U2", "ushort", 5123),
                                    Scalar::of<std::int32_t>("int32", "I4", "int", 0),
                                    Scalar::of<std::uint32_t>("uint32", "U4", "uint", 5125),
                                    Scalar::of<std::int64_t>("int64", "I8", "", 0),
                                    Scalar::of<std::uint64_t>("uint64", "U8", "", 0),
                                    Scalar::of<float>("float32", "F4", "float", 5126),
                                    Scalar::of<double>("float64", "F8", "double", 0)};

/// The first type of that kind; null if there is none.
template <class Is>
const Scalar* find_scalar(const Is& is) {
  const auto* const found = std::find_if(scalars.begin(), scalars.end(), is);
  return found == scalars.end() ? nullptr : found;
}

/// The next token of `rest`, which shrinks by it; empty if there is none. Blanks separate.
[[nodiscard]] std::string_view next_token(std::string_view& rest) noexcept;

/// The whole token as a number, "nan" and "inf" included; none if it is no number in range.
[[nodiscard]] std::optional<double> to_number(std::string_view token) noexcept;
/// The numbers of a list by blanks, commas and brackets; empty unless they are `count` finite ones.
[[nodiscard]] std::vector<double> to_numbers(std::string list, std::size_t count);
[[nodiscard]] std::optional<std::size_t> to_count(std::string_view token) noexcept;

/// A piece of a file as a message can show it: in quotes, printable and short.
[[nodiscard]] std::string quoted(std::string_view piece);

/// A colour's share, 0 to 1, as a byte; one that is no number is 0.
[[nodiscard]] std::uint8_t colour_byte(double share) noexcept;
/// The share that a splat's spherical harmonic of degree 0 stands for.
[[nodiscard]] inline double colour_share(double harmonic) noexcept {
  constexpr double y_0 = 0.28209479177387814;  // 1 / (2 sqrt(pi))
  return 0.5 + y_0 * harmonic;
}

[[nodiscard]] std::size_t count_non_finite(std::span<const Vec3> points) noexcept;

/// PCD and PLY files larger than this are not read.
inline constexpr std::uintmax_t largest_file = std::uintmax_t{1} << 32;
/// [bytes] that so many can hold at most by deflate.
constexpr std::size_t most_inflated(std::size_t size) noexcept {
  constexpr std::size_t times = 1032;
  return size > SIZE_MAX / times ? SIZE_MAX : times * size;
}

/// The bytes of a file that another one, `of`, says lies beside or below it.
/// @throws Error if it names a place elsewhere, or as read_file
std::vector<std::byte> read_beside(const std::filesystem::path& folder, const std::string& named,
                                   const std::string& of);

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

/// A value of each row of a table, or a list of them.
struct Column {
  std::string_view name;
  const Scalar* type = nullptr;
  std::size_t count = 1;           ///< values of a row, of which the first is used
  const Scalar* length = nullptr;  ///< the type of a list's length; null: no list
  bool is_bits = false;            ///< in text, a float32 whose bits are the value
  /// Takes a row's value; empty: it is checked and passed over.
  std::function<void(std::size_t row, double value)> put{};
  /// Makes room for that.
  std::function<void(std::size_t rows)> prepare{};
  /// A value in text has to be a number.
  bool is_needed = true;
  /// Takes the whole numbers of a row's list. @throws std::invalid_argument with what is wrong
  std::function<void(std::span<const std::int64_t> values)> put_list{};

  /// Of a row without a list's values.
  [[nodiscard]] std::size_t bytes() const {
    return length != nullptr ? length->size : count * type->size;
  }
};

/// A column's values become coordinate `axis` of `points`, which must outlive it.
void ask_for(Column& column, std::vector<Vec3>& points, std::size_t axis);

/// Makes room for what was asked for.
void prepare(std::span<const Column> columns, std::size_t rows);

/// Gives a column the values of some rows, `stride` bytes apart.
void take_column(const Column& column, const std::byte* first, std::size_t stride, std::size_t rows,
                 std::endian order, std::size_t first_row = 0);

/// How a table is written; order of none: as text, a line for each row.
using Order = std::optional<std::endian>;

/// Reads a table, whose rows are `noun`: "points". Nothing is allocated before their number is held
/// against what is left of the file.
void read_rows(Cursor& file, std::span<const Column> columns, std::size_t rows, Order order,
               const std::string& noun);

}  // namespace palpate::detail
