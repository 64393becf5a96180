// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include "palpate/io/bag/bag_reader.hpp"

namespace palpate::test {

/// Writes a file of MCAP into memory, record by record as https://mcap.dev/spec has them.
class McapWriter {
 public:
  struct Options {
    bool in_chunks = true;
    std::string compression{};  ///< of the chunks: none, "zstd" or "lz4"
    bool checksums = true;
    bool indexes = true;                   ///< of the messages, and a summary
    std::size_t chunk_bytes = 768 * 1024;  ///< rosbag2's own
  };

  explicit McapWriter(const Options& options) : options_(options) {
    file_ = magic;
    record(file_, 1, text("ros2") + text("palpate's tests"));
  }

  std::uint16_t channel(const std::string& topic, std::string_view type) {
    ++channels_;
    std::string both;
    record(both, 3, number(channels_) + text(type) + text("ros2msg") + text(""));
    record(both, 4,
           number(channels_) + number(channels_) + text(topic) + text("cdr") +
               number(std::uint32_t{0}));
    definitions_ += both;
    part() += both;
    return channels_;
  }

  void message(std::uint16_t channel, std::int64_t nanoseconds, std::span<const std::byte> bytes) {
    indexes_[channel] += number(nanoseconds) + number(std::uint64_t{chunk_.size()});
    record(part(), 5,
           number(channel) + number(std::uint32_t{0}) + number(nanoseconds) + number(nanoseconds) +
               std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
    ++messages_;
    if (options_.in_chunks && chunk_.size() >= options_.chunk_bytes) end_chunk();
  }

  void end_chunk() {
    if (!options_.in_chunks || chunk_.empty()) return;
    const std::string packed = compressed();
    const std::uint64_t begin = file_.size();
    record(file_, 6,
           number(std::uint64_t{0}) + number(std::uint64_t{0}) +
               number(std::uint64_t{chunk_.size()}) + number(crc(chunk_)) +
               text(options_.compression) + number(std::uint64_t{packed.size()}) + packed);
    const std::uint64_t end = file_.size();
    if (options_.indexes) {
      for (const auto& [channel, places] : indexes_)
        record(file_, 7, number(channel) + text(places));
      record(chunk_indexes_, 8,
             number(std::uint64_t{0}) + number(std::uint64_t{0}) + number(begin) +
                 number(end - begin) + text("") + number(std::uint64_t{file_.size() - end}) +
                 text(options_.compression) + number(std::uint64_t{packed.size()}) +
                 number(std::uint64_t{chunk_.size()}));
    }
    ++chunks_;
    indexes_.clear();
    chunk_.clear();
  }

  /// Any record, where the file is now.
  void put(std::uint8_t kind, const std::string& content) {
    end_chunk();
    record(file_, kind, content);
  }

  /// As a program leaves it that is killed now.
  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] std::uint64_t messages() const { return messages_; }

  /// @return the closed file
  std::string close() {
    end_chunk();
    record(file_, 15, number(crc(file_)));
    const std::uint64_t summary = options_.indexes ? file_.size() : 0;
    std::string end;
    if (options_.indexes) {
      end = definitions_ + chunk_indexes_;
      record(end, 11,
             number(messages_) + number(channels_) + number(std::uint32_t{channels_}) +
                 number(std::uint64_t{0}) + number(chunks_) + number(std::uint64_t{0}) +
                 number(std::uint64_t{0}) + text(""));
    }
    std::string footer;
    record(footer, 2, number(summary) + number(std::uint64_t{0}) + number(std::uint32_t{0}));
    footer.resize(footer.size() - sizeof(std::uint32_t));
    end += footer;
    return file_ + end + number(crc(end)) + magic;
  }

  template <class T>
  static std::string number(T value) {
    std::string bytes(sizeof value, '\0');
    std::memcpy(bytes.data(), &value, sizeof value);
    return bytes;
  }
  static std::string text(std::string_view value) {
    return number(static_cast<std::uint32_t>(value.size())) + std::string(value);
  }
  static void record(std::string& to, std::uint8_t kind, const std::string& content) {
    to += number(kind) + number(std::uint64_t{content.size()}) + content;
  }

 private:
  inline static const std::string magic = "\x89MCAP0\r\n";

  std::string& part() { return options_.in_chunks ? chunk_ : file_; }

  [[nodiscard]] std::uint32_t crc(const std::string& bytes) const {
    if (!options_.checksums) return 0;
    return static_cast<std::uint32_t>(
        crc32_z(0, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
  }

  [[nodiscard]] std::string compressed() const {
    std::string packed;
    if (options_.compression == "zstd") {
      packed.resize(ZSTD_compressBound(chunk_.size()));
      packed.resize(ZSTD_compress(packed.data(), packed.size(), chunk_.data(), chunk_.size(), 1));
    } else if (options_.compression == "lz4") {
      packed.resize(LZ4F_compressFrameBound(chunk_.size(), nullptr));
      packed.resize(
          LZ4F_compressFrame(packed.data(), packed.size(), chunk_.data(), chunk_.size(), nullptr));
    } else {
      packed = chunk_;
    }
    return packed;
  }

  Options options_;
  std::string file_, chunk_, definitions_, chunk_indexes_;
  std::map<std::uint16_t, std::string> indexes_;
  std::uint16_t channels_ = 0;
  std::uint64_t messages_ = 0;
  std::uint32_t chunks_ = 0;
};

/// Another bag, as a closed file of MCAP.
inline std::string as_mcap(const std::filesystem::path& bag, const McapWriter::Options& options) {
  BagReader reader(bag);
  McapWriter writer(options);
  struct Message {
    std::uint16_t channel;
    BagReader::Place place;
  };
  std::vector<Message> messages;
  for (const BagReader::Topic& topic : reader.topics()) {
    const std::uint16_t channel = writer.channel(topic.name, topic.type);
    for (const BagReader::Place& place : reader.places(topic.name))
      messages.push_back({channel, place});
  }
  std::stable_sort(messages.begin(), messages.end(), [](const Message& a, const Message& b) {
    return a.place.nanoseconds < b.place.nanoseconds;
  });
  for (const Message& message : messages)
    writer.message(message.channel, message.place.nanoseconds, reader.read(message.place));
  return writer.close();
}

}  // namespace palpate::test
