// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/bag/database.hpp"

namespace palpate {

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
  /// @throws Error if it cannot be read.
  [[nodiscard]] std::vector<std::byte> read(const Place& place);
  /// What errors call the message.
  [[nodiscard]] std::string name(std::string_view topic, const Place& place) const;

 private:
  struct File {
    Database database;
    // A topic's number in this file; not the same in all files of a bag.
    std::vector<std::pair<std::string, std::int64_t>> topics;
  };
  std::filesystem::path path_;
  std::vector<File> files_;
  std::vector<Topic> topics_;
};

}  // namespace palpate
