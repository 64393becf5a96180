// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/bag/compression.hpp"
#include "palpate/kernel/core/error.hpp"

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

/// What files of MCAP and of ROS 1 have in common: messages in chunks, whose places are known from
/// the file's indexes or from reading it through.
class ChunkedBag : public BagFile {
 public:
  [[nodiscard]] std::vector<BagTopic> topics() const final {
    std::vector<BagTopic> topics;
    for (const auto& [number, topic] : topics_) topics.push_back(topic);
    return topics;
  }

  [[nodiscard]] std::vector<Message> messages(std::string_view topic) final {
    std::vector<Message> messages;
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (topics_.at(entries_[i].topic).name == topic)
        messages.push_back({static_cast<std::int64_t>(i + 1), entries_[i].nanoseconds});
    }
    return messages;
  }

 protected:
  static constexpr std::uint64_t largest_record = 1U << 28U;  ///< [bytes], decompressed, too
  static constexpr std::uint32_t in_no_chunk = std::numeric_limits<std::uint32_t>::max();

  /// Where a message is.
  struct Entry {
    std::int64_t nanoseconds;
    std::uint64_t record;  ///< where in the file its record begins, or that of its chunk
    std::uint32_t offset;  ///< of its record in its chunk, or `in_no_chunk`
    std::uint32_t topic;   ///< its number in the file

    /// @throws Error if `index` says otherwise.
    void expect(const Entry& index, const BytePlace& place) const {
      if (topic != index.topic || nanoseconds != index.nanoseconds)
        place.fail("has another message than its index says");
    }
  };

  /// @param remedy    for a file that is damaged
  /// @param splitter  the program that splits one with too many messages
  ChunkedBag(const std::filesystem::path& path, const char* remedy, const char* splitter)
      : BagFile(path), file_(path), remedy_(remedy), splitter_(splitter) {}

  [[nodiscard]] BytePlace at(std::uint64_t byte) const { return {path(), byte, remedy_}; }

  void add(const Entry& entry) {
    constexpr std::size_t most = std::size_t{1} << 25U;
    if (entries_.size() == most)
      throw Error(path().string(), "has more than " + std::to_string(most) + " messages",
                  std::string("split it with ") + splitter_);
    entries_.push_back(entry);
  }
  /// Those from `first` on, which are of one chunk, in the order in which they lie in it.
  void sort_chunk(std::size_t first) {
    std::sort(entries_.begin() + static_cast<std::ptrdiff_t>(first), entries_.end(),
              [](const Entry& a, const Entry& b) { return a.offset < b.offset; });
  }

  /// A record that is outside of chunks; it has `place`, and `begin` and `size` of its content.
  template <class Record>
  [[nodiscard]] std::vector<std::byte> content_of(const Record& record) const {
    expect_size("record", record.size, record.place);
    return file_.bytes(record.begin, record.size);
  }
  void expect_size(const std::string& what, std::uint64_t size, std::uint64_t place) const {
    if (size > largest_record)
      at(place).fail("has a " + what + " of " + std::to_string(size) +
                     " bytes, more than can be read");
  }
  /// Makes a chunk of `size` the one that was read last.
  void unpack(std::string_view compression, std::span<const std::byte> packed, std::uint64_t size,
              std::uint64_t place) {
    expect_size("chunk", size, place);
    const std::string where = at(place).text();
    if (compression.empty() || compression == "none")
      chunk_.assign(packed.begin(), packed.end());
    else if (compression == "zstd")
      chunk_ = decompress_zstd(packed, size, where);
    else if (compression == "lz4")
      chunk_ = decompress_lz4(packed, size, where);
    else if (compression == "bz2")
      chunk_ = decompress_bz2(packed, size, where);
    else
      throw Error(where, "has a chunk of compression '" + std::string(compression) + "'",
                  "write it with zstd, lz4, bz2 or none");
    if (chunk_.size() != size) at(place).fail("has a chunk that is not of the size it says");
  }

  RandomAccess file_;
  std::map<std::uint32_t, BagTopic> topics_;
  std::vector<Entry> entries_;
  // The chunk that was read last
  std::uint64_t chunk_place_ = 0;  // 0: none
  std::vector<std::byte> chunk_;

 private:
  const char* remedy_;
  const char* splitter_;
};

}  // namespace palpate
