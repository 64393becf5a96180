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
#include <type_traits>
#include <utility>
#include <vector>

namespace palpate {

/// A message, or what one consists of: hands all its fields to `way`, in the order of ROS.
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

  /// The fields of a message, in this order.
  template <class... Fields>
  void operator()(const Fields&... fields) {
    (put(fields), ...);
  }
  void begin_header() {}

  [[nodiscard]] std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  static constexpr std::size_t header = 4;

  template <class T>
  void put(const T& value) {
    if constexpr (Walkable<T>)
      T::walk(*this, value);
    else
      put_all(&value, 1);
  }
  void put(const std::string& text) {  // and a NUL behind it
    put(static_cast<std::uint32_t>(text.size() + 1));
    put_all(text.c_str(), text.size() + 1);
  }
  template <class T, std::size_t n>
  void put(const std::array<T, n>& values) {
    put_all(values.data(), n);
  }
  template <class T>
  void put(const std::vector<T>& values) {
    put(static_cast<std::uint32_t>(values.size()));
    if constexpr (Plain<T>)
      put_all(values.data(), values.size());
    else
      for (const T& value : values) put(value);
  }

  template <Plain T>
  void put_all(const T* values, std::size_t count) {
    static_assert(std::endian::native == std::endian::little, "CDR is written as it lies in RAM");
    if (count == 0) return;
    const std::size_t past = (bytes_.size() - header) % sizeof(T);
    const std::size_t at = bytes_.size() + (past == 0 ? 0 : sizeof(T) - past);
    bytes_.resize(at + count * sizeof(T));
    std::memcpy(bytes_.data() + at, values, count * sizeof(T));
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

  /// The fields of a message, in this order. @throws Error if the message ends before.
  template <class... Fields>
  void operator()(Fields&... fields) {
    (get(fields), ...);
  }
  /// A header of ROS 1 begins with a number that ROS 2 has no more.
  void begin_header() {
    if (layout_ == Layout::ros1) static_cast<void>(number<std::uint32_t>());
  }

 private:
  template <class T>
  void get(T& value) {
    if constexpr (Walkable<T>)
      T::walk(*this, value);
    else
      value = number<T>();
  }
  void get(bool& value) { value = number<std::uint8_t>() != 0; }
  void get(std::string& text);
  template <class T, std::size_t n>
  void get(std::array<T, n>& values) {
    for (T& value : values) get(value);
  }
  template <class T>
  void get(std::vector<T>& values) {
    values.clear();
    if constexpr (std::is_same_v<T, std::byte>) {
      const std::span<const std::byte> bytes = take(count(1));
      values.assign(bytes.begin(), bytes.end());
    } else if constexpr (Plain<T>) {
      values.resize(count(sizeof(T)));
      for (T& value : values) value = number<T>();
    } else {  // grows with what is there: none is as short as what is asked for
      for (std::size_t left = count(1); left > 0; --left) get(values.emplace_back());
    }
  }

  template <class T>
  T number() {
    static_assert(std::is_arithmetic_v<T>);
    align(sizeof(T));
    const std::span<const std::byte> bytes = take(sizeof(T));
    std::array<std::byte, sizeof(T)> ordered{};
    std::memcpy(ordered.data(), bytes.data(), sizeof(T));
    if (swapped_) std::reverse(ordered.begin(), ordered.end());
    return std::bit_cast<T>(ordered);
  }
  // How many elements of at least `size` bytes follow.
  std::size_t count(std::size_t size);
  void align(std::size_t size);
  std::span<const std::byte> take(std::size_t count);

  std::span<const std::byte> body_;
  std::string name_;
  Layout layout_;
  std::size_t at_ = 0;
  bool swapped_ = false;
};

}  // namespace palpate
