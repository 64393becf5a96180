// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "palpate/bag/checksum.hpp"
#include "palpate/bag/database.hpp"

namespace palpate {

/// Writes a bag as ROS 2's rosbag2 does: a folder with metadata.yaml (version 7) and one file of
/// SQLite (schema 4). Beside what rosbag2 knows, each commit writes the checksums of its messages.
///
/// What was committed stays readable whatever happens to the program: SQLite keeps it in the
/// write-ahead log beside the file until the bag is closed. Used on one thread.
class BagWriter {
 public:
  /// @param folder     of the bag; must not be there yet
  /// @param max_bytes  of the file, for disks that are not ours alone; none: what the disk has
  /// @throws Error if it is there, or cannot be made.
  explicit BagWriter(const std::filesystem::path& folder,
                     std::optional<std::uint64_t> max_bytes = std::nullopt);
  /// Closes; what goes wrong then is not told.
  ~BagWriter();
  BagWriter(const BagWriter&) = delete;
  BagWriter& operator=(const BagWriter&) = delete;

  /// The topic to write to; made when it is first named.
  /// @param type     such as sensor_msgs/msg/Image
  /// @param latched  who comes late gets its last message too
  std::size_t topic(const std::string& name, std::string_view type, bool latched = false);
  /// @param nanoseconds  since 1970
  /// @param message      in CDR
  /// @throws Error if the disk is full or fails. What was committed before stays; nothing more can
  ///         be written.
  void write(std::size_t topic, std::int64_t nanoseconds, std::span<const std::byte> message);
  /// Makes what was written so far last, and metadata.yaml say how much that is. Throws as `write`.
  void commit();
  /// Commits and folds the log into the file. Throws as `write`.
  void close();

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] std::uint64_t messages() const { return messages_; }

 private:
  struct Topic {
    std::string name, type, profile;
    std::uint64_t messages = 0;
  };

  void write_checksums(bool closed);
  [[nodiscard]] std::string metadata() const;
  void write_metadata() const;

  std::filesystem::path folder_;
  std::string file_;
  std::vector<Topic> topics_;
  std::uint64_t messages_ = 0;
  std::int64_t first_ = 0, last_ = 0;  // [ns]
  ChecksumBlock checksums_;            // of what was written since the last commit
  std::uint32_t chain_ = 0;
  bool open_ = true;
  std::optional<Database> database_;
  std::optional<Statement> insert_;
};

}  // namespace palpate
