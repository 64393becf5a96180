// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/io/bag/bag_file.hpp"

namespace palpate {

/// Reads the messages of a ROS 2 bag whose storage is SQLite or MCAP, or of a bag of ROS 1.
///
/// metadata.yaml is not looked at: what it says of a bag whose program was killed is out of date.
/// Used on one thread.
class BagReader {
 public:
  /// @param path  the bag's folder, or one .db3, .mcap or .bag file
  /// @throws Error if there is no such bag, or it cannot be read.
  explicit BagReader(const std::filesystem::path& path);

  /// What it is, for people: "ROS 1 bag", "ROS 2 bag".
  [[nodiscard]] std::string_view kind() const { return files_.front()->kind(); }
  using Topic = BagTopic;
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
  std::vector<std::unique_ptr<BagFile>> files_;
  std::vector<Topic> topics_;
};

}  // namespace palpate
