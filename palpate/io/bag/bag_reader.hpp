// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate {

/// What the checksums of a bag say of its messages.
struct BagCheck {
  bool has_checksums = false;   ///< false: bags in SQLite or of ROS 1
  bool closed = true;           ///< false: its program was killed; it ends with what was whole
  std::uint64_t messages = 0;   ///< that are there
  std::uint64_t unchecked = 0;  ///< of these, without a checksum
  std::string damage{};         ///< the first message that is damaged or missing; empty if none is
};

/// A topic of a bag; the type as ROS 2 names it, such as sensor_msgs/msg/Image.
struct BagTopic {
  std::string name, type;
};

/// One file of a bag, whatever its storage. Used on one thread.
class BagFile {
 public:
  virtual ~BagFile() = default;
  BagFile(const BagFile&) = delete;
  BagFile& operator=(const BagFile&) = delete;

  struct Message {
    std::int64_t id;  ///< in this file
    std::int64_t nanoseconds;
  };
  struct Content {
    std::string_view topic;  ///< its name; lives as long as the file
    std::vector<std::byte> bytes;
  };

  /// What it is, for people: "ROS 2 bag".
  [[nodiscard]] virtual std::string_view kind() const { return "ROS 2 bag"; }
  /// In the order of the file; a name may come more than once.
  [[nodiscard]] virtual std::vector<BagTopic> topics() const = 0;
  /// Those of a topic in the order in which they were written, if any. @throws Error
  [[nodiscard]] virtual std::vector<Message> messages(std::string_view topic) = 0;
  /// @throws Error if it cannot be read, or is not what its checksum says.
  [[nodiscard]] virtual Content read(std::int64_t id) = 0;
  /// Reads everything and adds what it finds. Throws nothing for damage.
  virtual void check(BagCheck& check) = 0;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// What errors call a message.
  [[nodiscard]] std::string name(std::string_view topic, std::int64_t id) const;

 protected:
  explicit BagFile(std::filesystem::path path) : path_(std::move(path)) {}

 private:
  std::filesystem::path path_;
};

/// A file of SQLite, of any schema of rosbag2 so far. @throws Error if it is none.
std::unique_ptr<BagFile> open_sqlite_file(const std::filesystem::path& file);

/// A file of MCAP (https://mcap.dev/spec): messages within chunks or not, chunks uncompressed or
/// compressed with zstd or lz4. Its indexes are used where they are there and agree; else the file
/// is read through. One that was not closed ends with its last whole record. What it declares is
/// held against what is there before anything is allocated; one chunk is in memory at a time.
/// @throws Error if it is none, or damaged: what names the byte.
std::unique_ptr<BagFile> open_mcap_file(const std::filesystem::path& file);

/// A file of ROS 1 (rosbag, version 2.0, as librealsense writes them before 2.58): chunks
/// uncompressed or compressed with lz4 or bz2. All else as for MCAP. Types have the names, and
/// messages the serialization, of ROS 2; a message of a type that ros::from_ros1 does not know
/// cannot be read. @throws Error if it is none, or damaged.
std::unique_ptr<BagFile> open_ros1_file(const std::filesystem::path& file);

/// Any of them, by how the file begins and what its name ends with. @throws Error
std::unique_ptr<BagFile> open_bag_file(const std::filesystem::path& file);

/// Reads the messages of a ROS 2 bag whose storage is SQLite or MCAP, or of a bag of ROS 1, but not
/// metadata.yaml, which is out of date where a program was killed. Used on one thread.
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
  /// Reads all and compares it with the checksums: about 1 s a gigabyte. Throws nothing for damage.
  [[nodiscard]] BagCheck check();
  /// What errors call the message.
  [[nodiscard]] std::string name(std::string_view topic, const Place& place) const;

 private:
  std::vector<std::unique_ptr<BagFile>> files_;
  std::vector<Topic> topics_;
};

}  // namespace palpate
