// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <bzlib.h>
#include <lz4frame.h>

namespace palpate::test {

/// Numbers and texts as ROS 1 puts them into bags and messages: little-endian, one behind another.
namespace ros1 {

template <class T>
std::string number(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}
inline std::string text(std::string_view value) {
  return number(static_cast<std::uint32_t>(value.size())) + std::string(value);
}
/// @param at  [ns]
inline std::string time(std::int64_t at) {
  return number(static_cast<std::uint32_t>(at / 1'000'000'000)) +
         number(static_cast<std::uint32_t>(at % 1'000'000'000));
}
inline std::string header(std::int64_t at, std::string_view frame) {
  return number(std::uint32_t{77}) + time(at) + text(frame);
}
/// sensor_msgs/Image of 16 bits.
inline std::string image(std::int64_t at, std::uint32_t width, std::uint32_t height,
                         const std::vector<std::uint16_t>& depth, std::string_view encoding) {
  return header(at, "optical") + number(height) + number(width) + text(encoding) + '\0' +
         number(2 * width) + text({reinterpret_cast<const char*>(depth.data()), 2 * depth.size()});
}
/// sensor_msgs/CameraInfo.
inline std::string camera_info(std::uint32_t width, std::uint32_t height, double f, double cx,
                               double cy, std::string_view model, const std::vector<double>& d) {
  std::string bytes = header(0, "optical") + number(height) + number(width) + text(model) +
                      number(static_cast<std::uint32_t>(d.size()));
  for (const double each : d) bytes += number(each);
  for (const double each : {f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0}) bytes += number(each);
  bytes += std::string(9 * 8 + 12 * 8, '\0');   // R and P
  return bytes + std::string(6 * 4 + 1, '\0');  // binning, region, do_rectify
}

}  // namespace ros1

/// Writes a bag of ROS 1 into memory, record by record as http://wiki.ros.org/Bags/Format/2.0 has
/// them.
class Ros1BagWriter {
 public:
  /// @param compression  of the chunks: "none", "lz4" or "bz2"
  explicit Ros1BagWriter(std::string compression = "none") : compression_(std::move(compression)) {
    file_ = "#ROSBAG V2.0\n" + bag_record(0);
  }

  std::uint32_t connection(const std::string& topic, const std::string& type) {
    const auto number = static_cast<std::uint32_t>(connections_.size());
    connections_.push_back(
        record(field("op", "\x07") + field("conn", ros1::number(number)) + field("topic", topic),
               field("type", type) + field("md5sum", "*") + field("message_definition", "")));
    chunk_ += connections_.back();
    return number;
  }

  void message(std::uint32_t connection, std::int64_t at, const std::string& bytes) {
    indexes_[connection] +=
        ros1::time(at) + ros1::number(static_cast<std::uint32_t>(chunk_.size()));
    ++counts_[connection];
    ++messages_;
    chunk_ += record(field("op", "\x02") + field("conn", ros1::number(connection)) +
                         field("time", ros1::time(at)),
                     bytes);
  }
  /// To a topic that is made when it is first named.
  void message(const std::string& topic, const std::string& type, std::int64_t at,
               const std::string& bytes) {
    const auto known = topics_.find(topic);
    const std::uint32_t number =
        known != topics_.end() ? known->second
                               : topics_.emplace(topic, connection(topic, type)).first->second;
    message(number, at, bytes);
  }

  void end_chunk() {
    if (chunk_.empty()) return;
    infos_.push_back(
        record(field("op", "\x06") + field("ver", ros1::number(std::uint32_t{1})) +
                   field("chunk_pos", ros1::number(std::uint64_t{file_.size()})) +
                   field("start_time", ros1::time(0)) + field("end_time", ros1::time(0)) +
                   field("count", ros1::number(static_cast<std::uint32_t>(counts_.size()))),
               counts()));
    file_ += record(field("op", "\x05") + field("compression", compression_) +
                        field("size", ros1::number(static_cast<std::uint32_t>(chunk_.size()))),
                    compressed());
    for (const auto& [connection, places] : indexes_) {
      file_ += record(field("op", "\x04") + field("ver", ros1::number(std::uint32_t{1})) +
                          field("conn", ros1::number(connection)) +
                          field("count", ros1::number(counts_[connection])),
                      places);
    }
    indexes_.clear();
    counts_.clear();
    chunk_.clear();
  }

  /// Any bytes, where the file is now.
  void put(const std::string& bytes) {
    end_chunk();
    file_ += bytes;
  }

  /// As a program leaves it that is killed now.
  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] std::uint64_t messages() const { return messages_; }

  /// @return the closed file
  std::string close() {
    end_chunk();
    std::string closed = file_;
    const std::string first = bag_record(file_.size());
    closed.replace(file_.find('\n') + 1, first.size(), first);
    for (const std::string& connection : connections_) closed += connection;
    for (const std::string& info : infos_) closed += info;
    return closed;
  }

  static std::string field(const std::string& name, const std::string& value) {
    return ros1::text(name + "=" + value);
  }
  static std::string record(const std::string& head, const std::string& content) {
    return ros1::text(head) + ros1::text(content);
  }

 private:
  // Padded (to 4096 bytes by rosbag), so that it can be written again when the bag is closed.
  [[nodiscard]] std::string bag_record(std::uint64_t index) const {
    const std::string head =
        field("op", "\x03") + field("index_pos", ros1::number(index)) +
        field("conn_count", ros1::number(static_cast<std::uint32_t>(connections_.size()))) +
        field("chunk_count", ros1::number(static_cast<std::uint32_t>(infos_.size())));
    return record(head, std::string(padded - head.size(), ' '));
  }
  [[nodiscard]] std::string counts() const {
    std::string bytes;
    for (const auto& [connection, count] : counts_)
      bytes += ros1::number(connection) + ros1::number(count);
    return bytes;
  }
  [[nodiscard]] std::string compressed() const {
    std::string packed = chunk_;
    if (compression_ == "lz4") {
      packed.resize(LZ4F_compressFrameBound(chunk_.size(), nullptr));
      packed.resize(
          LZ4F_compressFrame(packed.data(), packed.size(), chunk_.data(), chunk_.size(), nullptr));
    } else if (compression_ == "bz2") {
      auto size = static_cast<unsigned>(chunk_.size() + chunk_.size() / 100 + 600);
      packed.resize(size);
      std::string copy = chunk_;
      BZ2_bzBuffToBuffCompress(packed.data(), &size, copy.data(),
                               static_cast<unsigned>(copy.size()), 1, 0, 0);
      packed.resize(size);
    }
    return packed;
  }

  static constexpr std::size_t padded = 200;

  std::string compression_, file_, chunk_;
  std::vector<std::string> connections_, infos_;
  std::map<std::string, std::uint32_t> topics_;
  std::map<std::uint32_t, std::string> indexes_;
  std::map<std::uint32_t, std::uint32_t> counts_;
  std::uint64_t messages_ = 0;
};

}  // namespace palpate::test
