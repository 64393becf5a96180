// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "palpate/drivers/cyclone_api.hpp"
#include "palpate/io/bag/messages.hpp"

namespace palpate::dds {

/// A message as a C struct, and the instructions by which Cyclone DDS writes and reads it. Fields
/// lie one after another, each at a multiple of its size; structs within are dissolved into theirs.
/// Sequences of numbers are not copied: they point into the message, which must outlive this.
class CSample {
 public:
  template <Walkable Message>
  explicit CSample(const Message& message) {
    lay(message);
    struct_.bytes.resize(aligned(struct_.bytes.size(), largest_alignment));
    instructions_ = struct_.whole();
  }
  CSample(const CSample&) = delete;
  CSample& operator=(const CSample&) = delete;

  [[nodiscard]] const void* data() const { return struct_.bytes.data(); }
  [[nodiscard]] std::size_t size() const { return struct_.bytes.size(); }
  [[nodiscard]] const std::vector<std::uint32_t>& instructions() const { return instructions_; }

  /// The fields of a message, in this order.
  template <class... Fields>
  void operator()(const Fields&... fields) {
    (lay(fields), ...);
  }
  void begin_header() {}

 private:
  using Code = std::vector<std::uint32_t>;
  struct CSequence {
    std::uint32_t most, length;
    const void* elements;
    bool is_released;
  };
  struct Struct {
    std::vector<std::byte> bytes;
    Code code;
    std::vector<std::pair<std::size_t, Code>> inner;  // of sequences of structs, by their places

    // With those of the inner structs behind, to which their sequences point.
    [[nodiscard]] Code whole() const {
      Code all = code;
      all.push_back(cyclone::op_return);
      for (const auto& [place, elements] : inner) {
        all[place + 3] |= static_cast<std::uint32_t>(all.size() - place);
        all.insert(all.end(), elements.begin(), elements.end());
      }
      return all;
    }
  };
  static constexpr std::size_t largest_alignment = 8;

  template <class T>
  void lay(const T& value) {
    if constexpr (Walkable<T>)
      T::walk(*this, value);
    else
      put(value, code_of<T>, 0);
  }
  void lay(const bool& value) { put(value, cyclone::of_flag, 0); }
  void lay(const std::string& value) { put(kept(value), cyclone::of_text, 0); }
  template <class T, std::size_t n>
  void lay(const std::array<T, n>& values) {
    put(values, cyclone::of_array, code_of<T>, sizeof(T));
    struct_.code.push_back(n);
  }
  void lay(const std::vector<std::string>& values) {
    std::vector<std::byte>& elements = elements_.emplace_back();
    for (const std::string& value : values) {
      const char* const text = kept(value);
      const auto* const bytes = reinterpret_cast<const std::byte*>(&text);
      elements.insert(elements.end(), bytes, bytes + sizeof(text));
    }
    put_sequence(values.size(), elements.data(), cyclone::of_text);
  }
  template <Plain T>
  void lay(const std::vector<T>& values) {
    put_sequence(values.size(), values.data(), code_of<T>);
  }
  template <class T>
  void lay(const std::vector<T>& values) {
    Struct outer = std::exchange(struct_, {});
    std::vector<std::byte>& elements = elements_.emplace_back();
    lay(values.empty() ? T{} : values.front());  // what an element is made of
    const Code code = struct_.whole();
    const std::size_t size = aligned(struct_.bytes.size(), largest_alignment);
    for (const T& value : values) {
      struct_ = {};
      lay(value);
      struct_.bytes.resize(size);
      elements.insert(elements.end(), struct_.bytes.begin(), struct_.bytes.end());
    }
    struct_ = std::move(outer);
    struct_.inner.emplace_back(struct_.code.size(), code);
    put_sequence(values.size(), elements.data(), cyclone::of_struct);
    constexpr std::uint32_t words = 4;  // until the next field's
    struct_.code.insert(struct_.code.end(), {static_cast<std::uint32_t>(size), words << 16});
  }

  // Of a number of 1, 2, 4 or 8 bytes, whose codes follow one another.
  template <class T>
  static constexpr std::uint32_t code_of = cyclone::of_1_byte +
                                           static_cast<std::uint32_t>(std::countr_zero(sizeof(T)));

  const char* kept(const std::string& text) { return texts_.emplace_back(text).c_str(); }
  static std::size_t aligned(std::size_t size, std::size_t alignment) {
    return (size + alignment - 1) / alignment * alignment;
  }

  void put_sequence(std::size_t count, const void* elements, std::uint32_t element) {
    const auto length = static_cast<std::uint32_t>(count);
    put(CSequence{length, length, elements, false}, cyclone::of_sequence, element,
        alignof(CSequence));
  }
  template <class T>
  void put(const T& value, std::uint32_t type, std::uint32_t element,
           std::size_t alignment = sizeof(T)) {
    static_assert(std::is_trivially_copyable_v<T>);
    const std::size_t offset = aligned(struct_.bytes.size(), alignment);
    struct_.bytes.resize(offset + sizeof(T));
    std::memcpy(struct_.bytes.data() + offset, &value, sizeof(T));
    struct_.code.push_back(cyclone::op_field | type << 16 | element << 8);
    struct_.code.push_back(static_cast<std::uint32_t>(offset));
  }

  Struct struct_;  // that is being laid
  Code instructions_;
  std::deque<std::string> texts_;                // pointed to
  std::deque<std::vector<std::byte>> elements_;  // of sequences, pointed to
};

}  // namespace palpate::dds
