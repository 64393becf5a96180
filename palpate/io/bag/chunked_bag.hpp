// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/io/bag/bag_file.hpp"
#include "palpate/io/bag/random_access.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {

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
