// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag/bag_writer.hpp"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>

#include <fcntl.h>
#include <unistd.h>
#include <zstd.h>

#include "palpate/io/bag/mcap_format.hpp"
#include "palpate/io/bag/messages.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr int metadata_version = 7;
constexpr std::string_view compression = "zstd";
constexpr int zstd_level = 3;  // 5 takes half as long again for 1 % less
// [bytes] before it is compressed: half a second of an ordinary camera
constexpr std::size_t largest_chunk = std::size_t{4} << 20U;

using Buffer = std::vector<std::byte>;

void put_bytes(Buffer& to, std::span<const std::byte> bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

template <class T>
void put(Buffer& to, T value) {
  static_assert(std::endian::native == std::endian::little, "numbers lie as in RAM");
  put_bytes(to, std::as_bytes(std::span(&value, 1)));
}

// Behind its length.
void put_block(Buffer& to, std::span<const std::byte> bytes) {
  put(to, static_cast<std::uint32_t>(bytes.size()));
  put_bytes(to, bytes);
}

void put_text(Buffer& to, std::string_view text) {
  put_block(to, std::as_bytes(std::span(text.data(), text.size())));
}

void put_record(Buffer& to, RecordKind kind, std::span<const std::byte> content) {
  put(to, kind);
  put(to, std::uint64_t{content.size()});
  put_bytes(to, content);
}

std::size_t compress(Buffer& into, std::span<const std::byte> bytes) {
  into.resize(ZSTD_compressBound(bytes.size()));
  return ZSTD_compress(into.data(), into.size(), bytes.data(), bytes.size(), zstd_level);
}

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

BagWriter::File::File(fs::path where)
    : path(std::move(where)),
      descriptor(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666)) {
  if (descriptor < 0)
    throw Error(path.string(), std::string("cannot be made: ") + std::strerror(errno),
                "check its folder's permissions, and that there is room on the disk");
}

BagWriter::File::~File() { ::close(descriptor); }

void BagWriter::Times::add(std::int64_t nanoseconds) {
  first = std::min(first, nanoseconds);
  last = std::max(last, nanoseconds);
}

BagWriter::BagWriter(const fs::path& folder)
    : folder_(folder.filename().empty() ? folder.parent_path() : folder),
      name_(folder_.filename().string() + "_0.mcap") {
  std::error_code error;
  if (fs::exists(folder_, error))
    throw Error(folder_.string(), "is there already", "name a folder that is not, or remove it");
  if (!fs::create_directories(folder_, error) || error)
    throw Error(folder_.string(), "cannot be made: " + error.message(),
                "check the path and its permissions");
  file_ = std::make_unique<File>(folder_ / name_);
  Bytes header;
  put_text(header, "ros2");
  put_text(header, "palpate");
  Bytes begin;
  put_bytes(begin, std::as_bytes(std::span(mcap_magic)));
  put_record(begin, RecordKind::header, header);
  append(begin);
  write_metadata();
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
  topics_.push_back({.name = name,
                     .type = std::string(type),
                     .profile = profile(latched),
                     .is_bulk = type == ros::CompressedImage::type || type == ros::Image::type ||
                                type == ros::PointCloud2::type});
  const auto number = static_cast<std::uint16_t>(topics_.size());
  Bytes schema;
  put(schema, number);
  put_text(schema, type);
  put_text(schema, "ros2msg");
  put_text(schema, ros::definition_of(type));
  Bytes notes;  // by their names
  put_text(notes, "offered_qos_profiles");
  put_text(notes, topics_.back().profile);
  Bytes channel;
  put(channel, number);
  put(channel, number);  // its schema
  put_text(channel, name);
  put_text(channel, "cdr");
  put_block(channel, notes);
  put_record(fresh_, RecordKind::schema, schema);
  put_record(fresh_, RecordKind::channel, channel);
  return topics_.size() - 1;
}

void BagWriter::write(std::size_t topic, std::int64_t nanoseconds,
                      std::span<const std::byte> message) {
  Topic& to = topics_[topic];
  const auto channel = static_cast<std::uint16_t>(topic + 1);
  Chunk& chunk = chunks_[to.is_bulk ? 0 : 1];
  Bytes& places = chunk.places[channel];
  put(places, nanoseconds);
  put(places, std::uint64_t{chunk.records.size()});
  put(chunk.records, RecordKind::message);
  put(chunk.records, std::uint64_t{message_head + message.size()});
  put(chunk.records, channel);
  put(chunk.records, static_cast<std::uint32_t>(to.messages));
  put(chunk.records, nanoseconds);  // of the recording, and of the message
  put(chunk.records, nanoseconds);
  put_bytes(chunk.records, message);
  chunk.times.add(nanoseconds);
  times_.add(nanoseconds);
  ++messages_;
  ++to.messages;
  if (chunk.records.size() >= largest_chunk) end_chunks();
}

// Bytes at the end of the file: all of them, or none that stay.
void BagWriter::append(std::span<const std::byte> bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t wrote = ::pwrite(file_->descriptor, bytes.data() + done, bytes.size() - done,
                                   static_cast<off_t>(size_ + done));
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote <= 0) {
      const int why = errno;
      open_ = false;
      static_cast<void>(::ftruncate(file_->descriptor, static_cast<off_t>(size_)));
      const bool full = why == ENOSPC || why == EDQUOT || why == EFBIG;
      throw Error(
          file_->path.string(),
          full ? "the disk is full" : std::string("cannot be written: ") + std::strerror(why),
          full ? "make room on the disk" : "check the disk");
    }
    done += static_cast<std::size_t>(wrote);
  }
  crc_ = crc32_on(crc_, bytes);
  size_ += bytes.size();
}

void BagWriter::end_chunk(Chunk& chunk) {
  if (chunk.records.empty()) return;
  Bytes packed;
  packed.resize(compress(packed, chunk.records));
  Bytes content;
  put(content, chunk.times.first);
  put(content, chunk.times.last);
  put(content, std::uint64_t{chunk.records.size()});
  put(content, crc32_on(0, chunk.records));
  put_text(content, compression);
  put(content, std::uint64_t{packed.size()});
  put_bytes(content, packed);
  Bytes record;
  put_record(record, RecordKind::chunk, content);
  const std::uint64_t begin = size_;
  const std::uint64_t length = record.size();
  Bytes indexes;  // where each topic's is
  for (const auto& [channel, places] : chunk.places) {
    put(indexes, channel);
    put(indexes, begin + record.size());
    Bytes index;
    put(index, channel);
    put_block(index, places);
    put_record(record, RecordKind::message_index, index);
  }
  append(record);
  Bytes entry;
  put(entry, chunk.times.first);
  put(entry, chunk.times.last);
  put(entry, begin);
  put(entry, length);
  put_block(entry, indexes);
  put(entry, std::uint64_t{record.size() - length});
  put_text(entry, compression);
  put(entry, std::uint64_t{packed.size()});
  put(entry, std::uint64_t{chunk.records.size()});
  put_record(chunk_indexes_, RecordKind::chunk_index, entry);
  ++chunk_count_;
  chunk.records.clear();
  chunk.places.clear();
  chunk.times = {};
}

// The images first, so that no tick in the file lacks the frame that it used.
void BagWriter::end_chunks() {
  if (!fresh_.empty()) append(fresh_);
  put_bytes(definitions_, fresh_);
  fresh_.clear();
  for (Chunk& chunk : chunks_) end_chunk(chunk);
}

void BagWriter::commit() {
  end_chunks();
  // What the machine itself may lose, should its power fail, is no more than came after this.
  static_cast<void>(::fdatasync(file_->descriptor));
  write_metadata();
}

void BagWriter::close() {
  if (!std::exchange(open_, false)) return;
  end_chunks();
  Bytes data_end;
  put(data_end, crc_);
  Bytes record;
  put_record(record, RecordKind::data_end, data_end);
  append(record);
  Bytes counts;  // of each topic's messages
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    put(counts, static_cast<std::uint16_t>(i + 1));
    put(counts, topics_[i].messages);
  }
  Bytes statistics;
  put(statistics, messages_);
  put(statistics, static_cast<std::uint16_t>(topics_.size()));  // schemas
  put(statistics, static_cast<std::uint32_t>(topics_.size()));  // channels
  put(statistics, std::uint64_t{0});                            // attachments and metadata
  put(statistics, chunk_count_);
  put(statistics, messages_ > 0 ? times_.first : 0);
  put(statistics, times_.last);
  put_block(statistics, counts);
  Bytes summary = definitions_;
  put_bytes(summary, chunk_indexes_);
  put_record(summary, RecordKind::statistics, statistics);
  put(summary, RecordKind::footer);
  put(summary, std::uint64_t{2 * sizeof(std::uint64_t) + sizeof(std::uint32_t)});
  put(summary, size_);             // where it begins
  put(summary, std::uint64_t{0});  // it has no table of its parts
  put(summary, crc32_on(0, summary));
  put_bytes(summary, std::as_bytes(std::span(mcap_magic)));
  append(summary);
  write_metadata();
}

std::string BagWriter::metadata() const {
  const bool any = messages_ > 0;
  const std::string count = std::to_string(messages_);
  const std::string duration = std::to_string(any ? times_.last - times_.first : 0);
  const std::string start = std::to_string(times_.first);
  std::string yaml = "version: " + std::to_string(metadata_version) +
                     "\nstorage_identifier: mcap\nduration:\n  nanoseconds: " + duration +
                     "\nstarting_time:\n  nanoseconds_since_epoch: " + start +
                     "\nmessage_count: " + count + "\ntopics_with_message_count:\n";
  if (topics_.empty()) yaml += "  []\n";
  for (const Topic& topic : topics_)
    yaml +=
        "  - topic_metadata:\n      name: " + quoted(topic.name) + "\n      type: " + topic.type +
        "\n      serialization_format: cdr\n      offered_qos_profiles: " + quoted(topic.profile) +
        "\n      type_description_hash: \"\"\n    message_count: " +
        std::to_string(topic.messages) + "\n";
  return yaml + "compression_format: \"\"\ncompression_mode: \"\"\nrelative_file_paths:\n  - " +
         quoted(name_) + "\nfiles:\n  - path: " + quoted(name_) +
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
