// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "palpate/bag/messages.hpp"

namespace palpate::ros {

/// One field of a message that lies in memory as a C struct.
struct CField {
  enum class Kind : std::uint8_t {
    number,   ///< of `size` bytes
    flag,     ///< bool
    text,     ///< const char*
    numbers,  ///< a sequence of numbers of `size` bytes
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

/// A message as a C struct, and what lies where in it: what C bindings of DDS take. Structs within
/// are dissolved into their fields. Long sequences of numbers are not copied: they point into the
/// message, which must outlive this. A sequence is {uint32 most, uint32 length, pointer, bool}.
class CSample {
 public:
  explicit CSample(const Image& message);
  explicit CSample(const CompressedImage& message);
  explicit CSample(const CameraInfo& message);
  explicit CSample(const PointCloud2& message);
  explicit CSample(const PoseStamped& message);
  explicit CSample(const WrenchStamped& message);
  explicit CSample(const TimeReference& message);
  explicit CSample(const TFMessage& message);
  explicit CSample(const Float64MultiArray& message);
  explicit CSample(const Bool& message);
  explicit CSample(const Point& message);
  explicit CSample(const Vector3& message);
  explicit CSample(const Wrench& message);
  explicit CSample(const OmniFeedback& message);
  CSample(const CSample&) = delete;
  CSample& operator=(const CSample&) = delete;

  [[nodiscard]] const void* data() const { return bytes_.data(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] const std::vector<CField>& fields() const { return fields_; }

 private:
  friend class Lay;
  template <class Message, class Walk>
  void lay(const Message& message, const Walk& walk);

  std::vector<std::byte> bytes_;
  std::vector<CField> fields_;
  std::deque<std::string> texts_;                // pointed to
  std::deque<std::vector<std::byte>> elements_;  // of sequences of structs, pointed to
};

}  // namespace palpate::ros
