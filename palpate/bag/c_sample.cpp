// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/c_sample.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "palpate/bag/message_walks.hpp"

namespace palpate::ros {
namespace {

struct CSequence {
  std::uint32_t most, length;
  const void* elements;
  bool is_released;
};

constexpr std::size_t largest_alignment = 8;

std::size_t aligned(std::size_t size, std::size_t alignment) {
  return (size + alignment - 1) / alignment * alignment;
}

}  // namespace

// Lays a message's fields one after another, each at a multiple of its size.
class Lay {
 public:
  explicit Lay(CSample& sample) : sample_(sample) {}

  void begin_header() {}
  template <class T>
  void number(const T& value) {
    put(value, {.kind = CField::Kind::number, .offset = 0, .size = sizeof(T)});
  }
  void flag(const bool& value) { put(value, {.kind = CField::Kind::flag, .offset = 0}); }
  void text(const std::string& value) {
    const char* const kept = sample_.texts_.emplace_back(value).c_str();
    put(kept, {.kind = CField::Kind::text, .offset = 0});
  }
  void bytes(const std::vector<std::byte>& value) { numbers(value); }
  template <class T>
  void numbers(const std::vector<T>& values) {
    sequence_of(values.size(), values.data(),
                {.kind = CField::Kind::numbers, .offset = 0, .size = sizeof(T)});
  }
  template <class T, std::size_t n>
  void array(const std::array<T, n>& values) {
    put(values, {.kind = CField::Kind::array, .offset = 0, .size = sizeof(T), .count = n},
        sizeof(T));
  }
  template <class T, class Each>
  void sequence(const std::vector<T>& values, std::size_t /*least*/, const Each& each) {
    const auto outer_bytes = std::exchange(bytes_, {});
    const auto outer_fields = std::exchange(fields_, {});
    std::vector<std::byte>& elements = sample_.elements_.emplace_back();
    const T none{};
    each(values.empty() ? none : values.front());  // what an element is made of
    const std::vector<CField> fields = fields_;
    const std::size_t size = aligned(bytes_.size(), largest_alignment);
    for (const T& value : values) {
      bytes_.clear();
      fields_.clear();
      each(value);
      bytes_.resize(size);
      elements.insert(elements.end(), bytes_.begin(), bytes_.end());
    }
    bytes_ = outer_bytes;
    fields_ = outer_fields;
    sequence_of(values.size(), elements.data(),
                {.kind = CField::Kind::structs, .offset = 0, .size = size, .fields = fields});
  }

  void finish() {
    bytes_.resize(aligned(bytes_.size(), largest_alignment));
    sample_.bytes_ = std::move(bytes_);
    sample_.fields_ = std::move(fields_);
  }

 private:
  void sequence_of(std::size_t count, const void* elements, CField field) {
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

template <class Message, class Walk>
void CSample::lay(const Message& message, const Walk& walk) {
  Lay way(*this);
  walk(way, message);
  way.finish();
}

CSample::CSample(const Image& message) {
  lay(message, image);
}
CSample::CSample(const CompressedImage& message) {
  lay(message, compressed);
}
CSample::CSample(const CameraInfo& message) {
  lay(message, camera);
}
CSample::CSample(const PointCloud2& message) {
  lay(message, points);
}
CSample::CSample(const PoseStamped& message) {
  lay(message, pose);
}
CSample::CSample(const WrenchStamped& message) {
  lay(message, wrench);
}
CSample::CSample(const TimeReference& message) {
  lay(message, time_reference);
}
CSample::CSample(const TFMessage& message) {
  lay(message, transforms);
}
CSample::CSample(const Float64MultiArray& message) {
  lay(message, multi_array);
}
CSample::CSample(const Bool& message) {
  lay(message, boolean);
}
CSample::CSample(const Point& message) {
  lay(message, point);
}
CSample::CSample(const Vector3& message) {
  lay(message, point);
}
CSample::CSample(const Wrench& message) {
  lay(message, plain_wrench);
}
CSample::CSample(const OmniFeedback& message) {
  lay(message, omni_feedback);
}

}  // namespace palpate::ros
