// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/bag_reader.hpp"

#include <algorithm>
#include <utility>

#include "palpate/bag/compression.hpp"
#include "palpate/core/error.hpp"

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
    if (path.extension() == ".bag")
      throw Error(path.string(), "is a bag of ROS 1",
                  "convert it: one of RealSense's with rs-convert -i FILE.bag -D FILE.db3");
    if (path.extension() == ".mkv")
      throw Error(path.string(), "is a video, such as an Azure Kinect's",
                  "write its depth as 16-bit PNGs, and name their folder with depth:FOLDER");
    if (path.extension() == ".mcap")
      throw Error(path.string(), "is an MCAP file",
                  "convert it to SQLite, with ros2 bag convert and storage_id sqlite3");
    return {path};
  }
  std::vector<fs::path> files;
  bool mcap = false;
  bool compressed = false;
  for (auto entry = fs::directory_iterator(path, error); !error && entry != fs::end(entry);
       entry.increment(error)) {
    const fs::path extension = entry->path().extension();
    if (extension == ".db3") files.push_back(entry->path());
    mcap = mcap || extension == ".mcap";
    compressed = compressed || extension == ".zstd";
  }
  if (error) throw Error(path.string(), "cannot be listed: " + error.message(), "check the path");
  if (files.empty()) {
    if (mcap)
      throw Error(path.string(), "is a bag of MCAP files",
                  "convert it to SQLite, with ros2 bag convert and storage_id sqlite3");
    if (compressed)
      throw Error(path.string(), "is a compressed bag",
                  "decompress its files with zstd -d, or the bag with ros2 bag convert");
    throw Error(path.string(), "holds no .db3 file", "name the folder of a ROS 2 bag");
  }
  std::sort(files.begin(), files.end(),
            [](const fs::path& a, const fs::path& b) { return file_order(a) < file_order(b); });
  return files;
}

// A view of that name could compute for ever.
void expect_table(const Database& database, const std::string& name) {
  Statement look(database, "SELECT type FROM sqlite_master WHERE name = ?");
  look.bind(0, name);
  if (!look.step() || look.text(0) != "table")
    throw Error(database.file().string(), "has no table of " + name, "name a bag of ROS 2");
}

}  // namespace

BagReader::BagReader(const fs::path& path) : path_(path) {
  for (const fs::path& file : files_of(path)) {
    File& entry = files_.emplace_back(File{Database::open(file), {}, {}});
    expect_table(entry.database, "topics");
    expect_table(entry.database, "messages");
    Statement list(entry.database, "SELECT id, name, type FROM topics ORDER BY id");
    while (list.step()) {
      Topic topic{.name = list.text(1), .type = list.text(2)};
      entry.topics.emplace_back(topic, list.integer(0));
      if (find(topic.name) == nullptr) topics_.push_back(std::move(topic));
      if (topics_.size() > most_topics)
        throw Error(file.string(), "has too many topics", "it may be damaged");
    }
    entry.checksums = read_checksums(entry.database);
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
    for (const auto& [each, id] : files_[i].topics) {
      if (each.name != topic) continue;
      Statement list(files_[i].database,
                     "SELECT id, timestamp FROM messages WHERE topic_id = ? ORDER BY id");
      list.bind(0, id);
      while (list.step()) places.push_back({i, list.integer(0), list.integer(1)});
    }
  }
  return places;
}

const BagReader::Topic* BagReader::File::find(std::int64_t number) const {
  const auto topic = std::find_if(topics.begin(), topics.end(),
                                  [&](const auto& each) { return each.second == number; });
  return topic == topics.end() ? nullptr : &topic->first;
}

std::vector<std::byte> BagReader::read(const Place& place) {
  const File& file = files_[place.file];
  Statement select(file.database, "SELECT data, topic_id, timestamp FROM messages WHERE id = ?");
  select.bind(0, place.id);
  if (!select.step())
    throw Error(file.database.file().string(), "message " + std::to_string(place.id) + " is gone",
                "do not change a bag while it is read");
  const std::span<const std::byte> bytes = select.bytes(0);
  if (const std::uint32_t* expected = file.checksums.find(place.id)) {
    const Topic* topic = file.find(select.integer(1));
    if (topic == nullptr ||
        checksum_of(topic->name, topic->type, select.integer(2), bytes) != *expected)
      throw Error(name(topic == nullptr ? "an unknown topic" : topic->name, place),
                  "is not what its checksum says",
                  "it is damaged; what was recorded before it can be used");
  }
  if (is_zstd(bytes)) {
    const Topic* topic = file.find(select.integer(1));
    return decompress_zstd(bytes, largest_message,
                           name(topic == nullptr ? "an unknown topic" : topic->name, place));
  }
  return {bytes.begin(), bytes.end()};
}

void BagReader::check(const File& file, BagCheck& check) {
  const auto damaged = [&](const std::string& what) {
    if (check.damage.empty()) check.damage = file.database.file().string() + ": " + what;
  };
  const Checksums& checksums = file.checksums;
  std::int64_t expected = 1;  // the next message's id
  std::int64_t covered = 0;   // the last id that has a checksum
  if (!checksums.blocks.empty()) {
    const ChecksumBlock& last = checksums.blocks.back();
    covered = last.first + static_cast<std::int64_t>(last.messages.size()) - 1;
    check.closed = last.closed;
  }
  try {
    Statement list(file.database, "SELECT id, topic_id, timestamp, data FROM messages ORDER BY id");
    while (list.step()) {
      ++check.messages;
      const std::int64_t id = list.integer(0);
      const std::uint32_t* checksum = checksums.find(id);
      if (checksum == nullptr) {
        ++check.unchecked;
        continue;
      }
      if (id != expected) damaged("message " + std::to_string(expected) + " is missing");
      expected = id + 1;
      const Topic* topic = file.find(list.integer(1));
      if (topic == nullptr)
        damaged("message " + std::to_string(id) + " is of no topic");
      else if (checksum_of(topic->name, topic->type, list.integer(2), list.bytes(3)) != *checksum)
        damaged("message " + std::to_string(id) + " of " + topic->name +
                " is not what its checksum says");
    }
    if (expected <= covered) damaged("message " + std::to_string(expected) + " is missing");
  } catch (const Error& error) {
    if (check.damage.empty()) check.damage = error.what();
  }
  if (!checksums.damage.empty()) damaged(checksums.damage);
}

BagCheck BagReader::check() {
  BagCheck check;
  for (const File& file : files_) {
    check.has_checksums = check.has_checksums || file.checksums.there;
    BagReader::check(file, check);
  }
  return check;
}

std::string BagReader::name(std::string_view topic, const Place& place) const {
  return files_[place.file].database.file().string() + ": message " + std::to_string(place.id) +
         " of " + std::string(topic);
}

}  // namespace palpate
