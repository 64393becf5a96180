// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <zstd.h>

#include "palpate/io/bag/messages.hpp"

#include "tests/support/sqlite.hpp"

namespace palpate::test {

/// Writes a file as librealsense 2.58 records it: rosbag2's SQLite without metadata.yaml, texts
/// where ROS has messages of its own, each message compressed with zstd or not.
class RealSenseRecording {
 public:
  static constexpr const char* depth_topic = "/device_0/sensor_0/Depth_0/image/data";
  static constexpr const char* info_topic = "/device_0/sensor_0/Depth_0/camera_info";
  static constexpr const char* units_topic = "/device_0/sensor_0/option/Depth_Units/value";
  static constexpr const char* device_topic = "/device_0/info";

  RealSenseRecording(std::filesystem::path file, bool compressed)
      : file_(std::move(file)),
        compressed_(compressed),
        sql_(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,"
            "serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,"
            "timestamp INTEGER NOT NULL,data BLOB NOT NULL);"
            "CREATE INDEX timestamp_idx ON messages(timestamp ASC);"
            "BEGIN;") {
    write("/file_version", "std_msgs/msg/UInt32", 0, std::vector<std::byte>(8));
  }

  ~RealSenseRecording() { run_sql(file_, sql_ + "COMMIT"); }
  RealSenseRecording(const RealSenseRecording&) = delete;
  RealSenseRecording& operator=(const RealSenseRecording&) = delete;

  /// A message as it is, or compressed.
  void write(std::string_view topic, std::string_view type, std::int64_t at,
             std::vector<std::byte> message) {
    if (compressed_) {
      std::vector<std::byte> packed(ZSTD_compressBound(message.size()));
      packed.resize(ZSTD_compress(packed.data(), packed.size(), message.data(), message.size(), 1));
      message = std::move(packed);
    }
    write_raw(topic, type, at, message);
  }
  void write_raw(std::string_view topic, std::string_view type, std::int64_t at,
                 const std::vector<std::byte>& bytes) {
    std::int64_t id = 0;
    for (std::size_t i = 0; i < topics_.size(); ++i) {
      if (topics_[i] == topic) id = static_cast<std::int64_t>(i) + 1;
    }
    if (id == 0) {
      topics_.emplace_back(topic);
      id = static_cast<std::int64_t>(topics_.size());
      sql_ += "INSERT INTO topics VALUES(" + std::to_string(id) + ",'" + std::string(topic) +
              "','" + std::string(type) + "','cdr','');";
    }
    constexpr std::string_view digits = "0123456789abcdef";
    sql_ += "INSERT INTO messages(topic_id,timestamp,data) VALUES(" + std::to_string(id) + "," +
            std::to_string(at) + ",x'";
    for (const std::byte byte : bytes) {
      sql_ += digits[std::to_integer<unsigned>(byte) >> 4U];
      sql_ += digits[std::to_integer<unsigned>(byte) & 15U];
    }
    sql_ += "');";
  }
  void text(std::string_view topic, std::int64_t at, const std::string& text) {
    write(topic, ros::String::type, at, ros::encode(ros::String{text}));
  }
  /// What every recording begins with.
  void describe(const std::string& lens, const std::string& unit,
                const std::string& product = "Intel RealSense D435") {
    text(device_topic, 0, "Name=" + product + ";Serial Number=123456789012;Product Id=0B07");
    text("/device_0/sensor_0/info", 0, "Name=Stereo Module");
    text("/device_0/sensor_0/Depth_0/info", 0, "encoding=Z16;fps=30;is_recommended=true");
    if (!lens.empty()) text(info_topic, 0, lens);
    if (!unit.empty()) text(units_topic, 0, unit);
  }
  void image(std::int64_t at, std::uint32_t width, std::uint32_t height,
             const std::vector<std::uint16_t>& depth, std::string_view topic = depth_topic) {
    const auto bytes = std::as_bytes(std::span(depth));
    write(topic, ros::Image::type, at,
          ros::encode(ros::Image{.header = {ros::Time::at(at), "Depth"},
                                 .height = height,
                                 .width = width,
                                 .encoding = "mono16",
                                 .step = 2 * width,
                                 .data = {bytes.begin(), bytes.end()}}));
  }

 private:
  std::filesystem::path file_;
  bool compressed_;
  std::string sql_;
  std::vector<std::string> topics_;
};

}  // namespace palpate::test
