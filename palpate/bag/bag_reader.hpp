// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/bag/checksum.hpp"
#include "palpate/bag/database.hpp"

namespace palpate {

/// What the checksums of a bag say of its messages.
struct BagCheck {
  bool has_checksums = false;   ///< false: others' bags, and palpate's up to version 0.1
  bool closed = false;          ///< false: its program was killed; it ends with its last commit
  std::uint64_t messages = 0;   ///< that are there
  std::uint64_t unchecked = 0;  ///< of these, without a checksum
  std::string damage{};         ///< the first message that is damaged or missing; empty if none is
};

/// Reads the messages of a ROS 2 bag whose storage is SQLite, of any schema of rosbag2 so far.
///
/// metadata.yaml is not looked at: what it says of a bag whose program was killed is out of date.
/// Used on one thread.
class BagReader {
 public:
  /// @param path  the bag's folder, or one .db3 file of it
  /// @throws Error if there is no such bag, or it is not SQLite's.
  explicit BagReader(const std::filesystem::path& path);

  struct Topic {
    std::string name, type;
  };
  /// Sorted by name.
  [[nodiscard]] const std::vector<Topic>& topics() const { return topics_; }
  [[nodiscard]] const Topic* find(std::string_view name) const;

  /// Where a message lies.
  struct Place {
    std::size_t file;
    std::int64_t id, nanoseconds;
  };
  /// All messages of a topic in the order in which they were written; none of an unknown one.
  [[nodiscard]] std::vector<Place> places(std::string_view topic);
  /// Its message; one that is compressed with zstd, as librealsense and rosbag2 (compression mode
  /// MESSAGE) can write it, is decompressed.
  /// @throws Error if it cannot be read, or is not what its checksum says.
  [[nodiscard]] std::vector<std::byte> read(const Place& place);
  /// Reads everything and compares it with the checksums: about 1 s a gigabyte. Throws nothing for
  /// damage.
  [[nodiscard]] BagCheck check();
  /// What errors call the message.
  [[nodiscard]] std::string name(std::string_view topic, const Place& place) const;

 private:
  struct File {
    Database database;
    // With a topic's number in this file; not the same in all files of a bag.
    std::vector<std::pair<Topic, std::int64_t>> topics;
    Checksums checksums;

    [[nodiscard]] const Topic* find(std::int64_t number) const;
  };
  static void check(const File& file, BagCheck& check);
  std::filesystem::path path_;
  std::vector<File> files_;
  std::vector<Topic> topics_;
};

}  // namespace palpate
