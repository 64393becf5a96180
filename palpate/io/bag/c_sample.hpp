// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "palpate/io/bag/messages.hpp"

namespace palpate::ros {

/// One field of a message that lies in memory as a C struct.
struct CField {
  enum class Kind : std::uint8_t {
    number,   ///< of `size` bytes
    flag,     ///< bool
    text,     ///< const char*
    numbers,  ///< a sequence of numbers of `size` bytes
    texts,    ///< a sequence of const char*
    array,    ///< `count` numbers of `size` bytes
    structs,  ///< a sequence of structs of `size` bytes with `fields`
  };
  Kind kind;
  std::size_t offset;            ///< [bytes] from the beginning of its struct
  std::size_t size = 0;          ///< [bytes]
  std::size_t count = 0;         ///< of an array
  std::vector<CField> fields{};  ///< of a struct

  friend bool operator==(const CField&, const CField&) = default;
};

class Lay;

/// A message as a C struct, and what lies where in it: what C bindings of DDS take. Structs within
/// are dissolved into their fields. Long sequences of numbers are not copied: they point into the
/// message, which must outlive this. A sequence is {uint32 most, uint32 length, pointer, bool}.
class CSample {
 public:
  template <Walkable Message>
  explicit CSample(const Message& message);
  CSample(const CSample&) = delete;
  CSample& operator=(const CSample&) = delete;

  [[nodiscard]] const void* data() const { return bytes_.data(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] const std::vector<CField>& fields() const { return fields_; }

 private:
  friend class Lay;

  std::vector<std::byte> bytes_;
  std::vector<CField> fields_;
  std::deque<std::string> texts_;                // pointed to
  std::deque<std::vector<std::byte>> elements_;  // of sequences, pointed to
};

/// Lays a message's fields one after another, each at a multiple of its size.
class Lay {
 public:
  explicit Lay(CSample& sample) : sample_(sample) {}

  /// The fields of a message, in this order.
  template <class... Fields>
  void operator()(const Fields&... fields) {
    (lay(fields), ...);
  }
  void begin_header() {}

  void finish() {
    bytes_.resize(aligned(bytes_.size(), largest_alignment));
    sample_.bytes_ = std::move(bytes_);
    sample_.fields_ = std::move(fields_);
  }

 private:
  struct CSequence {
    std::uint32_t most, length;
    const void* elements;
    bool is_released;
  };
  static constexpr std::size_t largest_alignment = 8;

  template <class T>
  void lay(const T& value) {
    if constexpr (Walkable<T>)
      T::walk(*this, value);
    else
      put(value, {.kind = CField::Kind::number, .offset = 0, .size = sizeof(T)});
  }
  void lay(const bool& value) { put(value, {.kind = CField::Kind::flag, .offset = 0}); }
  void lay(const std::string& value) {
    put(kept(value), {.kind = CField::Kind::text, .offset = 0});
  }
  template <class T, std::size_t n>
  void lay(const std::array<T, n>& values) {
    put(values, {.kind = CField::Kind::array, .offset = 0, .size = sizeof(T), .count = n},
        sizeof(T));
  }
  void lay(const std::vector<std::string>& values) {
    std::vector<std::byte>& elements = sample_.elements_.emplace_back();
    for (const std::string& value : values) {
      const char* const text = kept(value);
      const auto* const bytes = reinterpret_cast<const std::byte*>(&text);
      elements.insert(elements.end(), bytes, bytes + sizeof(text));
    }
    put_sequence(values.size(), elements.data(), {.kind = CField::Kind::texts, .offset = 0});
  }
  template <Plain T>
  void lay(const std::vector<T>& values) {
    put_sequence(values.size(), values.data(),
                 {.kind = CField::Kind::numbers, .offset = 0, .size = sizeof(T)});
  }
  template <class T>
  void lay(const std::vector<T>& values) {
    const auto outer_bytes = std::exchange(bytes_, {});
    const auto outer_fields = std::exchange(fields_, {});
    std::vector<std::byte>& elements = sample_.elements_.emplace_back();
    lay(values.empty() ? T{} : values.front());  // what an element is made of
    const std::vector<CField> fields = fields_;
    const std::size_t size = aligned(bytes_.size(), largest_alignment);
    for (const T& value : values) {
      bytes_.clear();
      fields_.clear();
      lay(value);
      bytes_.resize(size);
      elements.insert(elements.end(), bytes_.begin(), bytes_.end());
    }
    bytes_ = outer_bytes;
    fields_ = outer_fields;
    put_sequence(values.size(), elements.data(),
                 {.kind = CField::Kind::structs, .offset = 0, .size = size, .fields = fields});
  }

  const char* kept(const std::string& text) { return sample_.texts_.emplace_back(text).c_str(); }
  static std::size_t aligned(std::size_t size, std::size_t alignment) {
    return (size + alignment - 1) / alignment * alignment;
  }

  void put_sequence(std::size_t count, const void* elements, CField field) {
    const auto length = static_cast<std::uint32_t>(count);
    put(CSequence{length, length, elements, false}, std::move(field), alignof(CSequence));
  }
  template <class T>
  void put(const T& value, CField field, std::size_t alignment = sizeof(T)) {
    static_assert(std::is_trivially_copyable_v<T>);
    field.offset = aligned(bytes_.size(), alignment);
    bytes_.resize(field.offset + sizeof(T));
    std::memcpy(bytes_.data() + field.offset, &value, sizeof(T));
    fields_.push_back(std::move(field));
  }

  CSample& sample_;
  std::vector<std::byte> bytes_;  // of the struct that is being laid
  std::vector<CField> fields_;
};

template <Walkable Message>
CSample::CSample(const Message& message) {
  Lay way(*this);
  way(message);
  way.finish();
}

}  // namespace palpate::ros
