// SPDX-License-Identifier: Apache-2.0
// Binary files that are read at any place: what the storages of bags share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace palpate {

/// A place in a file, for errors.
struct BytePlace {
  const std::filesystem::path& file;
  std::uint64_t byte;
  const char* remedy;  ///< for such a file that is damaged

  [[nodiscard]] std::string text() const;
  /// @throws Error
  [[noreturn]] void fail(const std::string& why) const;
};

/// A file that is read at any place. Used on one thread.
class RandomAccess {
 public:
  /// @throws Error
  explicit RandomAccess(const std::filesystem::path& path);
  ~RandomAccess();
  RandomAccess(const RandomAccess&) = delete;
  RandomAccess& operator=(const RandomAccess&) = delete;

  [[nodiscard]] std::uint64_t size() const { return size_; }
  /// @throws Error if there is less.
  void read(std::uint64_t at, std::span<std::byte> into) const;
  /// @pre `size` was held against the file's  @throws Error
  [[nodiscard]] std::vector<std::byte> bytes(std::uint64_t at, std::uint64_t size) const;
  [[nodiscard]] std::uint32_t crc32(std::uint64_t from, std::uint64_t to) const;

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
};

/// The fields of a record, one after another, little-endian.
class RecordFields {
 public:
  /// @param left  must outlive this
  RecordFields(std::span<const std::byte> left, const BytePlace& place)
      : left_(left), place_(place) {}

  /// @throws Error if there is less.
  std::span<const std::byte> take(std::uint64_t count) {
    if (count > left_.size()) place_.fail("has a record that is shorter than its fields");
    const auto taken = left_.first(count);
    left_ = left_.subspan(count);
    return taken;
  }
  template <class T>
  T number() {
    static_assert(std::is_integral_v<T>);
    T value{};
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  /// Behind its length.
  std::span<const std::byte> block() { return take(number<std::uint32_t>()); }
  std::string text() {
    const auto bytes = block();
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  [[nodiscard]] std::span<const std::byte> left() const { return left_; }

 private:
  std::span<const std::byte> left_;
  BytePlace place_;
};

}  // namespace palpate
