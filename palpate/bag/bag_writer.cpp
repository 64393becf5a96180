// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/bag_writer.hpp"

#include <algorithm>
#include <fstream>
#include <limits>
#include <sstream>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr int metadata_version = 7;
constexpr int schema_version = 4;

// Names as rosbag2 makes them.
constexpr const char* tables =
    "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);"
    "CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,"
    "metadata TEXT NOT NULL);"
    "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,"
    "serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL,"
    "type_description_hash TEXT NOT NULL);"
    "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,"
    "encoding TEXT NOT NULL,encoded_message_definition TEXT NOT NULL,"
    "type_description_hash TEXT NOT NULL);"
    "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,"
    "timestamp INTEGER NOT NULL,data BLOB NOT NULL);"
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC);";

// Quality of service as rosbag2 notes it: keep the last 10, reliable.
std::string profile(bool latched) {
  const std::string for_ever = "\n    sec: 2147483647\n    nsec: 4294967295";
  return "- history: 1\n  depth: 10\n  reliability: 1\n  durability: " +
         std::string(latched ? "1" : "2") + "\n  deadline:" + for_ever +
         "\n  lifespan:" + for_ever + "\n  liveliness: 1\n  liveliness_lease_duration:" + for_ever +
         "\n  avoid_ros_namespace_conventions: false";
}

// A YAML string in double quotes.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '\n') {
      result += "\\n";
    } else {
      if (c == '"' || c == '\\') result += '\\';
      result += c;
    }
  }
  return result + '"';
}

}  // namespace

BagWriter::BagWriter(const fs::path& folder, std::optional<std::uint64_t> max_bytes)
    : folder_(folder.filename().empty() ? folder.parent_path() : folder),
      file_(folder_.filename().string() + "_0.db3") {
  std::error_code error;
  if (fs::exists(folder_, error))
    throw Error(folder_.string(), "is there already", "name a folder that is not, or remove it");
  if (!fs::create_directories(folder_, error) || error)
    throw Error(folder_.string(), "cannot be made: " + error.message(),
                "check the path and its permissions");
  database_.emplace(Database::create(folder_ / file_));
  // The log makes commits cheap and lets others read meanwhile. A process that dies loses nothing
  // that was committed; a machine that does, at most what the disk had not got yet.
  database_->run("PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL");
  if (max_bytes) {
    constexpr std::uint64_t page = 4096;
    database_->run("PRAGMA max_page_count = " +
                   std::to_string(std::max<std::uint64_t>(*max_bytes / page, 1)));
  }
  database_->run(tables);
  database_->run("INSERT INTO schema VALUES(" + std::to_string(schema_version) + ",'rolling')");
  insert_.emplace(*database_, "INSERT INTO messages(topic_id,timestamp,data) VALUES(?,?,?)");
  write_metadata();
  database_->run("BEGIN");
}

BagWriter::~BagWriter() {
  try {
    close();
  } catch (const Error&) {  // the bag ends with what was committed
  }
}

std::size_t BagWriter::topic(const std::string& name, std::string_view type, bool latched) {
  const auto known = std::find_if(topics_.begin(), topics_.end(),
                                  [&](const Topic& topic) { return topic.name == name; });
  if (known != topics_.end()) return static_cast<std::size_t>(known - topics_.begin());
  topics_.push_back({.name = name, .type = std::string(type), .profile = profile(latched)});
  const Topic& topic = topics_.back();
  Statement insert(*database_, "INSERT INTO topics VALUES(?,?,?,'cdr',?,'')");
  insert.bind(0, static_cast<std::int64_t>(topics_.size()));
  insert.bind(1, topic.name);
  insert.bind(2, topic.type);
  insert.bind(3, topic.profile);
  insert.run();
  return topics_.size() - 1;
}

void BagWriter::write(std::size_t topic, std::int64_t nanoseconds,
                      std::span<const std::byte> message) {
  insert_->bind(0, static_cast<std::int64_t>(topic + 1));
  insert_->bind(1, nanoseconds);
  insert_->bind(2, message);
  insert_->run();
  first_ = messages_ == 0 ? nanoseconds : std::min(first_, nanoseconds);
  last_ = messages_ == 0 ? nanoseconds : std::max(last_, nanoseconds);
  ++messages_;
  ++topics_[topic].messages;
  checksums_.messages.push_back(
      checksum_of(topics_[topic].name, topics_[topic].type, nanoseconds, message));
}

void BagWriter::write_checksums(bool closed) {
  checksums_.closed = closed;
  if (!closed && checksums_.messages.empty()) return;
  chain_ = append(*database_, chain_, checksums_);
  checksums_.first += static_cast<std::int64_t>(checksums_.messages.size());
  checksums_.messages.clear();
}

void BagWriter::commit() {
  write_checksums(false);
  database_->run("COMMIT");
  write_metadata();
  database_->run("BEGIN");
}

void BagWriter::close() {
  if (!std::exchange(open_, false)) return;
  write_checksums(true);
  Statement insert(*database_, "INSERT INTO metadata(metadata_version,metadata) VALUES(?,?)");
  const std::string text = metadata();
  insert.bind(0, std::int64_t{metadata_version});
  insert.bind(1, text);
  insert.run();
  database_->run("COMMIT");
  write_metadata();
  insert_.reset();
  // One file again, that can be read where nothing can be written.
  database_->run("PRAGMA journal_mode = DELETE");
}

std::string BagWriter::metadata() const {
  const bool any = messages_ > 0;
  const std::string count = std::to_string(messages_);
  const std::string duration = std::to_string(last_ - first_);
  const std::string start = std::to_string(any ? first_ : std::numeric_limits<std::int64_t>::max());
  std::string yaml = "version: " + std::to_string(metadata_version) +
                     "\nstorage_identifier: sqlite3\nduration:\n  nanoseconds: " + duration +
                     "\nstarting_time:\n  nanoseconds_since_epoch: " + start +
                     "\nmessage_count: " + count + "\ntopics_with_message_count:\n";
  if (topics_.empty()) yaml += "  []\n";
  for (const Topic& topic : topics_) {
    yaml +=
        "  - topic_metadata:\n      name: " + quoted(topic.name) + "\n      type: " + topic.type +
        "\n      serialization_format: cdr\n      offered_qos_profiles: " + quoted(topic.profile) +
        "\n      type_description_hash: \"\"\n    message_count: " +
        std::to_string(topic.messages) + "\n";
  }
  return yaml + "compression_format: \"\"\ncompression_mode: \"\"\nrelative_file_paths:\n  - " +
         quoted(file_) + "\nfiles:\n  - path: " + quoted(file_) +
         "\n    starting_time:\n      nanoseconds_since_epoch: " + start +
         "\n    duration:\n      nanoseconds: " + duration + "\n    message_count: " + count +
         "\ncustom_data: ~\n";
}

void BagWriter::write_metadata() const {
  // Written beside and put in its place, so that there is always a whole one.
  const fs::path place = folder_ / "metadata.yaml";
  const fs::path fresh = folder_ / "metadata.yaml.new";
  std::ofstream out(fresh);
  out << "rosbag2_bagfile_information:\n";
  std::istringstream lines(metadata());
  for (std::string line; std::getline(lines, line);) out << "  " << line << '\n';
  out.close();
  std::error_code error;
  if (out) fs::rename(fresh, place, error);
  if (!out || error)
    throw Error(place.string(), "cannot be written",
                "check the disk, and that there is room on it");
}

}  // namespace palpate
