// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// Writes a bag as ROS 2's rosbag2 does: a folder with metadata.yaml (version 7) and one file of
/// MCAP, in chunks that are compressed with zstd and have checksums. Images and points are in
/// chunks of their own, so that nobody has to unpack them for what lies between. What was committed
/// stays readable whatever happens: the file only grows, by whole chunks. Used on one thread.
class BagWriter {
 public:
  /// @param folder  of the bag; must not be there yet
  /// @throws Error if it is there, or cannot be made.
  explicit BagWriter(const std::filesystem::path& folder);
  /// Closes; what goes wrong then is not told.
  ~BagWriter();

  /// The topic to write to; made when it is first named.
  /// @param type     such as sensor_msgs/msg/Image
  /// @param latched  who comes late gets its last message too
  std::size_t topic(const std::string& name, std::string_view type, bool latched = false);
  /// @param nanoseconds  since 1970
  /// @param message      in CDR
  /// @throws Error if the disk is full or fails. What was committed before stays; nothing more can
  ///         be written.
  void write(std::size_t topic, std::int64_t nanoseconds, std::span<const std::byte> message);
  /// Makes what was written so far last, and says so in metadata.yaml. Throws as `write`.
  void commit();
  /// Commits and ends the file with its index. Throws as `write`.
  void close();

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] std::uint64_t messages() const { return messages_; }
  [[nodiscard]] std::uint64_t bytes() const { return size_; }  ///< of the file so far

 private:
  using Bytes = std::vector<std::byte>;
  struct Topic {
    std::string name, type, profile;
    bool is_bulk;  // images and points
    std::uint64_t messages = 0;
  };
  struct Times {  // [ns]
    std::int64_t first = std::numeric_limits<std::int64_t>::max(), last = 0;
    void add(std::int64_t nanoseconds);
  };
  struct Chunk {
    Bytes records;
    Times times;
    std::map<std::uint16_t, Bytes> places;  // of each topic's messages in it: time and offset
  };
  struct File {
    explicit File(std::filesystem::path where);
    ~File();
    File(const File&) = delete;
    File& operator=(const File&) = delete;
    std::filesystem::path path;
    int descriptor;
  };

  void end_chunks();
  void end_chunk(Chunk& chunk);
  void append(std::span<const std::byte> bytes);
  [[nodiscard]] std::string metadata() const;
  void write_metadata() const;

  std::filesystem::path folder_;
  std::string name_;  // of the file
  std::unique_ptr<File> file_;
  std::vector<Topic> topics_;
  std::array<Chunk, 2> chunks_;  // of images and points, and of all else
  Bytes definitions_, fresh_;    // of the topics; of these, what is not in the file yet
  Bytes chunk_indexes_;
  std::uint64_t messages_ = 0, size_ = 0;
  std::uint32_t chunk_count_ = 0, crc_ = 0;  // of all bytes of the file
  Times times_;
  bool open_ = true;
};

}  // namespace palpate
