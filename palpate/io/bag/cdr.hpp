// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace palpate {

/// A message, or what one consists of: hands its fields to `way`, all at once and in the order of
/// its definition.
template <class T>
concept Walkable = requires(int& way, const T& message) {
  T::walk(way, message);
};

/// What is copied as it lies in memory.
template <class T>
concept Plain = std::is_arithmetic_v<T> || std::is_same_v<T, std::byte>;

/// Writes a message as ROS 2 does: OMG CDR, version 1, little-endian, behind the four bytes that
/// say so. A number lies at a multiple of its size, counted from behind those four bytes.
class CdrWriter {
 public:
  CdrWriter() : bytes_{std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}} {}

  template <class T>
  void put(T value) {
    static_assert(std::is_arithmetic_v<T>);
    align(sizeof(T));
    append(&value, 1);
  }
  template <class T>
  void put_array(std::span<const T> values) {
    static_assert(Plain<T>);
    if (values.empty()) return;
    align(sizeof(T));
    append(values.data(), values.size());
  }
  /// A sequence: how many, then the elements.
  template <class T>
  void put_sequence(std::span<const T> values) {
    put(static_cast<std::uint32_t>(values.size()));
    put_array(values);
  }
  /// Without a NUL within; one is put behind it.
  void put_string(std::string_view text) {
    put(static_cast<std::uint32_t>(text.size() + 1));
    append(text.data(), text.size());
    bytes_.push_back(std::byte{0});
  }

  /// The fields of a message, in this order.
  template <class... Fields>
  void operator()(const Fields&... fields) {
    (put_field(fields), ...);
  }
  void begin_header() {}

  [[nodiscard]] std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  static constexpr std::size_t header = 4;

  template <class T>
  void put_field(const T& value) {
    if constexpr (Walkable<T>)
      T::walk(*this, value);
    else
      put(value);
  }
  void put_field(const std::string& text) { put_string(text); }
  template <class T, std::size_t n>
  void put_field(const std::array<T, n>& values) {
    put_array(std::span<const T>(values));
  }
  template <class T>
  void put_field(const std::vector<T>& values) {
    if constexpr (Plain<T>) {
      put_sequence(std::span(values));
    } else {
      put(static_cast<std::uint32_t>(values.size()));
      for (const T& value : values) put_field(value);
    }
  }

  void align(std::size_t size) {
    const std::size_t past = (bytes_.size() - header) % size;
    if (past != 0) bytes_.resize(bytes_.size() + size - past);
  }
  template <class T>
  void append(const T* values, std::size_t count) {
    static_assert(std::endian::native == std::endian::little, "CDR is written as it lies in RAM");
    const std::size_t at = bytes_.size();
    bytes_.resize(at + count * sizeof(T));
    if (count > 0) std::memcpy(bytes_.data() + at, values, count * sizeof(T));
  }

  std::vector<std::byte> bytes_;
};

/// Reads what CdrWriter and ROS 2 write, in either byte order, or what ROS 1 wrote: the same, but
/// little-endian, without the four bytes, and no number aligned. What a message promises is held
/// against its length before anything is allocated.
class CdrReader {
 public:
  enum class Layout : std::uint8_t { cdr, ros1 };

  /// @param message  must outlive this
  /// @param name     of the message, for errors
  /// @throws Error if it is not plain CDR.
  CdrReader(std::span<const std::byte> message, std::string name, Layout layout = Layout::cdr);

  /// @throws Error if the message ends before.
  template <class T>
  T get() {
    static_assert(std::is_arithmetic_v<T>);
    align(sizeof(T));
    const std::span<const std::byte> bytes = take(sizeof(T));
    std::array<std::byte, sizeof(T)> ordered{};
    std::memcpy(ordered.data(), bytes.data(), sizeof(T));
    if (swapped_) std::reverse(ordered.begin(), ordered.end());
    return std::bit_cast<T>(ordered);
  }
  template <class T>
  std::vector<T> get_sequence() {
    std::vector<T> values(get_count(sizeof(T)));
    for (T& value : values) value = get<T>();
    return values;
  }
  /// A sequence of bytes, as it lies in the message.
  std::span<const std::byte> get_bytes() { return take(get_count(1)); }
  std::string get_string();
  /// How many elements of at least `size` bytes follow.
  std::size_t get_count(std::size_t size);

  /// The fields of a message, in this order.
  template <class... Fields>
  void operator()(Fields&... fields) {
    (get_field(fields), ...);
  }
  /// A header of ROS 1 begins with a number that ROS 2 has no more.
  void begin_header() {
    if (layout_ == Layout::ros1) static_cast<void>(get<std::uint32_t>());
  }

 private:
  template <class T>
  void get_field(T& value) {
    if constexpr (Walkable<T>)
      T::walk(*this, value);
    else
      value = get<T>();
  }
  void get_field(bool& value) { value = get<std::uint8_t>() != 0; }
  void get_field(std::string& text) { text = get_string(); }
  template <class T, std::size_t n>
  void get_field(std::array<T, n>& values) {
    for (T& value : values) get_field(value);
  }
  template <class T>
  void get_field(std::vector<T>& values) {
    values.clear();
    if constexpr (std::is_same_v<T, std::byte>) {
      const std::span<const std::byte> bytes = get_bytes();
      values.assign(bytes.begin(), bytes.end());
    } else if constexpr (Plain<T>) {
      values = get_sequence<T>();
    } else {  // grows with what is there: none is as short as what is asked for
      for (std::size_t left = get_count(1); left > 0; --left) get_field(values.emplace_back());
    }
  }

  void align(std::size_t size);
  std::span<const std::byte> take(std::size_t count);

  std::span<const std::byte> body_;
  std::string name_;
  Layout layout_;
  std::size_t at_ = 0;
  bool swapped_ = false;
};

}  // namespace palpate
