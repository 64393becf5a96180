// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag/bag_reader.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <set>

#include "palpate/io/bag/compression.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_topics = 10'000;
constexpr std::size_t largest_message = std::size_t{1} << 28U;  // [bytes] when decompressed

// The number before the extension: rosbag2 names the files of a bag NAME_0.db3, NAME_1.db3, ...
std::pair<std::size_t, std::string> file_order(const fs::path& file) {
  std::string stem = file.stem().string();
  const std::size_t digits = stem.find_last_not_of("0123456789") + 1;
  // Of numbers without leading zeros the longer is the larger.
  return {stem.size() - digits, stem};
}

std::vector<fs::path> files_of(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) {
    if (!fs::exists(path, error)) throw Error(path.string(), "no such bag", "check the path");
    if (path.extension() == ".mkv")
      throw Error(path.string(), "is a video, such as an Azure Kinect's",
                  "write its depth as 16-bit PNGs, and name their folder with depth:FOLDER");
    return {path};
  }
  std::vector<fs::path> files;
  std::set<fs::path> endings;
  for (auto entry = fs::directory_iterator(path, error); !error && entry != fs::end(entry);
       entry.increment(error)) {
    const fs::path extension = entry->path().extension();
    if (extension == ".db3" || extension == ".mcap") files.push_back(entry->path());
    endings.insert(extension);
  }
  if (error) throw Error(path.string(), "cannot be listed: " + error.message(), "check the path");
  if (files.empty()) {
    if (endings.contains(".zstd"))
      throw Error(path.string(), "is a compressed bag",
                  "decompress its files with zstd -d, or the bag with ros2 bag convert");
    if (endings.contains(".bag"))
      throw Error(path.string(), "holds bags of ROS 1", "name one of its .bag files");
    throw Error(path.string(), "holds no .db3 or .mcap file", "name the folder of a ROS 2 bag");
  }
  if (endings.contains(".db3") && endings.contains(".mcap"))
    throw Error(path.string(), "holds .db3 and .mcap files, so more than one bag",
                "name one of the files");
  std::sort(files.begin(), files.end(),
            [](const fs::path& a, const fs::path& b) { return file_order(a) < file_order(b); });
  return files;
}

}  // namespace

BagReader::BagReader(const fs::path& path) {
  for (const fs::path& file : files_of(path)) {
    for (Topic& topic : files_.emplace_back(open_bag_file(file))->topics()) {
      if (find(topic.name) == nullptr) topics_.push_back(std::move(topic));
      if (topics_.size() > most_topics)
        throw Error(file.string(), "has too many topics", "it may be damaged");
    }
  }
  std::sort(topics_.begin(), topics_.end(),
            [](const Topic& a, const Topic& b) { return a.name < b.name; });
}

const BagReader::Topic* BagReader::find(std::string_view name) const {
  const auto topic =
      std::find_if(topics_.begin(), topics_.end(), [&](const Topic& t) { return t.name == name; });
  return topic == topics_.end() ? nullptr : &*topic;
}

std::vector<BagReader::Place> BagReader::places(std::string_view topic) {
  std::vector<Place> places;
  for (std::size_t i = 0; i < files_.size(); ++i) {
    for (const BagFile::Message& message : files_[i]->messages(topic))
      places.push_back({i, message.id, message.nanoseconds});
  }
  return places;
}

std::vector<std::byte> BagReader::read(const Place& place) {
  BagFile::Content content = files_[place.file]->read(place.id);
  if (!is_zstd(content.bytes)) return std::move(content.bytes);
  return decompress_zstd(content.bytes, largest_message, name(content.topic, place));
}

BagCheck BagReader::check() {
  BagCheck check;
  for (const auto& file : files_) file->check(check);
  return check;
}

std::string BagReader::name(std::string_view topic, const Place& place) const {
  return files_[place.file]->name(topic, place.id);
}

std::string BagFile::name(std::string_view topic, std::int64_t id) const {
  return path_.string() + ": message " + std::to_string(id) + " of " + std::string(topic);
}

std::unique_ptr<BagFile> open_bag_file(const std::filesystem::path& file) {
  constexpr std::string_view mcap = "\x89MCAP";
  constexpr std::string_view ros1 = "#ROSBAG";
  constexpr std::string_view sqlite = "SQLite";
  std::array<char, ros1.size()> begin{};
  std::error_code error;
  if (std::filesystem::is_regular_file(file, error))
    std::ifstream(file, std::ios::binary).read(begin.data(), begin.size());
  const std::string_view text(begin.data(), begin.size());
  if (text.starts_with(mcap) || file.extension() == ".mcap") return open_mcap_file(file);
  const bool is_named_bag = file.extension() == ".bag" && !text.starts_with(sqlite);
  if (text.starts_with(ros1) || is_named_bag) return open_ros1_file(file);
  return open_sqlite_file(file);
}

}  // namespace palpate
