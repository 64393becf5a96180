// SPDX-License-Identifier: Apache-2.0
// The format is described at http://wiki.ros.org/Bags/Format/2.0.
#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "palpate/io/bag/chunked_bag.hpp"
#include "palpate/io/bag/messages.hpp"

namespace palpate {
namespace {

constexpr std::string_view ros1_magic = "#ROSBAG V2.0\n";
constexpr std::uint64_t largest_ros1_head = 1U << 20U;  // [bytes] of a record's fields
constexpr std::size_t most_ros1_connections = 100'000;
constexpr std::size_t ros1_index_entry = 12;  // [bytes] time and offset
constexpr const char* ros1_remedy = "copy it again, or save the undamaged part with rosbag reindex";

enum class Ros1Kind : std::uint8_t {
  message = 2,
  bag = 3,
  index = 4,
  chunk = 5,
  chunk_info = 6,
  connection = 7,
};

// The fields at the head of a record, each NAME=VALUE behind its length.
class Ros1Head {
 public:
  // @param bytes  must outlive this
  Ros1Head(std::span<const std::byte> bytes, const BytePlace& place) : place_(place) {
    RecordFields fields(bytes, place);
    while (!fields.left().empty()) {
      const std::span<const std::byte> field = fields.block();
      const std::string_view text(reinterpret_cast<const char*>(field.data()), field.size());
      const std::size_t equals = text.find('=');
      if (equals == std::string_view::npos) place_.fail("has a record with a field of no name");
      fields_.insert_or_assign(text.substr(0, equals), text.substr(equals + 1));
    }
  }

  [[nodiscard]] std::optional<Ros1Kind> kind() const {
    const auto op = fields_.find("op");
    if (op == fields_.end() || op->second.size() != 1) return std::nullopt;
    return static_cast<Ros1Kind>(op->second.front());
  }
  [[nodiscard]] bool has(std::string_view name) const { return fields_.contains(name); }
  [[nodiscard]] std::string_view text(std::string_view name) const {
    const auto field = fields_.find(name);
    if (field == fields_.end()) place_.fail("has a record without '" + std::string(name) + "'");
    return field->second;
  }
  template <class T>
  [[nodiscard]] T number(std::string_view name) const {
    static_assert(std::is_integral_v<T>);
    const std::string_view bytes = text(name);
    T value{};
    if (bytes.size() != sizeof value)
      place_.fail("has a record whose '" + std::string(name) + "' is no number");
    std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }

 private:
  std::map<std::string_view, std::string_view> fields_;
  BytePlace place_;
};

// Seconds, then nanoseconds behind them. @return [ns]
std::int64_t ros1_time(std::uint64_t time) {
  return static_cast<std::int64_t>((time & 0xffffffffU) * 1'000'000'000U + (time >> 32U));
}

// As ROS 2 names it.
std::string ros2_type(std::string_view type) {
  if (type == "tf/tfMessage") return std::string(ros::TFMessage::type);
  const std::size_t slash = type.find('/');
  if (slash == std::string_view::npos) return std::string(type);
  return std::string(type.substr(0, slash)) + "/msg" + std::string(type.substr(slash));
}

class Ros1File final : public ChunkedBag {
 public:
  explicit Ros1File(const std::filesystem::path& path)
      : ChunkedBag(path, ros1_remedy, "rosbag filter") {
    expect_magic();
    const std::optional<Record> first = record_at(ros1_magic.size());
    if (!first) at(ros1_magic.size()).fail("ends before what is in it");
    const Ros1Head head(first->head, at(first->place));
    if (head.kind() != Ros1Kind::bag) at(first->place).fail("does not begin as a bag");
    if (head.has("encryptor") && !head.text("encryptor").empty())
      throw Error(path.string(), "is encrypted", "decrypt it with rosbag decrypt");
    begin_ = first->end();
    const auto index = head.number<std::uint64_t>("index_pos");
    closed_ = index >= begin_ && index <= file_.size();
    end_ = closed_ ? index : file_.size();
    if (closed_ && read_index(head.number<std::uint32_t>("conn_count"),
                              head.number<std::uint32_t>("chunk_count")))
      return;
    entries_.clear();
    walk([this](const Entry& entry) { add(entry); });
  }

  [[nodiscard]] std::string_view kind() const override { return "ROS 1 bag"; }

  [[nodiscard]] Content read(std::int64_t id) override {
    const Entry& entry = entries_.at(static_cast<std::size_t>(id - 1));
    const BytePlace place = at(entry.record);
    const std::span<const std::byte> records = chunk_at(entry.record);
    if (entry.offset > records.size()) place.fail("has a chunk that ends before its index says");
    const Inner inner = inner_at(records, entry.offset, place);
    const Ros1Head head(inner.head, place);
    if (head.kind() != Ros1Kind::message) place.fail("has no message where its index names one");
    entry_of(head, entry.record, entry.offset).expect(entry, place);
    const BagTopic& topic = topics_.at(entry.topic);
    return {topic.name, ros::from_ros1(topic.type, inner.content, name(topic.name, id))};
  }

  void check(BagCheck& check) override {
    check.closed = check.closed && closed_;
    std::uint64_t messages = 0;
    std::string damage = index_damage_;
    try {
      walk([&messages](const Entry& /*entry*/) { ++messages; });
    } catch (const Error& error) {
      damage = error.what();
    }
    if (check.damage.empty()) check.damage = damage;
    check.messages += messages;
    check.unchecked += messages;
  }

 private:
  // A record of the file, outside of chunks.
  struct Record {
    std::vector<std::byte> head;
    std::uint64_t place, begin, size;  // of the record; of its content

    [[nodiscard]] std::uint64_t end() const { return begin + size; }
  };
  // One within a chunk.
  struct Inner {
    std::span<const std::byte> head, content;
    std::size_t end;  // in the chunk
  };
  void expect_magic() const {
    std::array<char, ros1_magic.size()> bytes{};
    const std::string_view begin(bytes.data(), bytes.size());
    if (file_.size() >= bytes.size()) file_.read(0, std::as_writable_bytes(std::span(bytes)));
    if (begin == ros1_magic) return;
    if (begin.starts_with("#ROSBAG V"))
      throw Error(path().string(), "is a bag of ROS 1 in an older format than 2.0",
                  "convert it with rosbag reindex");
    throw Error(path().string(), "is no bag of ROS 1", "name a bag of ROS 1 or 2");
  }

  // None where the file ends before the record does.
  [[nodiscard]] std::optional<Record> record_at(std::uint64_t place) const {
    std::uint64_t left = file_.size() - std::min(place, file_.size());
    std::uint32_t size = 0;
    const auto length = [&](std::uint64_t where) {
      if (left < sizeof size) return false;
      file_.read(where, std::as_writable_bytes(std::span(&size, 1)));
      left -= sizeof size;
      return size <= left;
    };
    if (!length(place)) return std::nullopt;
    if (size > largest_ros1_head) at(place).fail("has a record whose head is too long");
    Record record{
        .head = file_.bytes(place + sizeof size, size), .place = place, .begin = 0, .size = 0};
    left -= size;
    record.begin = place + 2 * sizeof size + size;
    if (!length(record.begin - sizeof size)) return std::nullopt;
    record.size = size;
    return record;
  }

  static Inner inner_at(std::span<const std::byte> records, std::size_t offset,
                        const BytePlace& place) {
    RecordFields fields(records.subspan(offset), place);
    Inner inner{};
    inner.head = fields.block();
    inner.content = fields.block();
    inner.end = records.size() - fields.left().size();
    return inner;
  }

  void take_connection(const Ros1Head& head, std::span<const std::byte> content,
                       std::uint64_t place) {
    const auto number = head.number<std::uint32_t>("conn");
    if (topics_.contains(number)) return;
    if (topics_.size() == most_ros1_connections) at(place).fail("has too many connections");
    const Ros1Head inner(content, at(place));
    topics_.emplace(number,
                    BagTopic{std::string(head.text("topic")), ros2_type(inner.text("type"))});
  }

  [[nodiscard]] Entry entry_of(const Ros1Head& head, std::uint64_t chunk,
                               std::size_t offset) const {
    const auto connection = head.number<std::uint32_t>("conn");
    expect_connection(connection, chunk);
    return {ros1_time(head.number<std::uint64_t>("time")), chunk,
            static_cast<std::uint32_t>(offset), connection};
  }

  void expect_connection(std::uint32_t connection, std::uint64_t place) const {
    if (!topics_.contains(connection))
      at(place).fail("has a message of connection " + std::to_string(connection) +
                     ", which is not declared in the file");
  }

  // The records of the chunk that begins there, decompressed, until the next is asked for.
  std::span<const std::byte> chunk_at(std::uint64_t place) {
    if (chunk_place_ == place) return chunk_;
    chunk_place_ = 0;
    const std::optional<Record> record = record_at(place);
    if (!record) at(place).fail("has a chunk that ends behind the end of the file");
    const Ros1Head head(record->head, at(place));
    const auto size = head.number<std::uint32_t>("size");
    unpack(head.text("compression"), content_of(*record), size, place);
    chunk_place_ = place;
    return chunk_;
  }

  // Calls on_record(Record, Ros1Head) for each record before the index. One that was not closed
  // ends with its last whole record.
  template <class OnRecord>
  void for_each_record(const OnRecord& on_record) const {
    for (std::uint64_t place = begin_; place < end_;) {
      const std::optional<Record> record = record_at(place);
      if (!record || (!closed_ && record->head.empty())) {
        if (closed_) at(place).fail("has a record that ends behind the end of the file");
        return;
      }
      on_record(*record, Ros1Head(record->head, at(place)));
      place = record->end();
    }
  }

  // Reads all chunks, and calls take(Entry) for each message.
  template <class Take>
  void walk(const Take& take) {
    for_each_record([&](const Record& record, const Ros1Head& head) {
      if (head.kind() == Ros1Kind::connection)
        take_connection(head, content_of(record), record.place);
      if (head.kind() != Ros1Kind::chunk) return;
      const std::span<const std::byte> records = chunk_at(record.place);
      for (std::size_t offset = 0; offset < records.size();) {
        const Inner inner = inner_at(records, offset, at(record.place));
        const Ros1Head inner_head(inner.head, at(record.place));
        if (inner_head.kind() == Ros1Kind::connection)
          take_connection(inner_head, inner.content, record.place);
        else if (inner_head.kind() == Ros1Kind::message)
          take(entry_of(inner_head, record.place, offset));
        else
          at(record.place).fail("has a chunk with a record of no kind");
        offset = inner.end;
      }
    });
  }

  // Takes the messages' places from the file's own indexes. False where it has none for all of its
  // messages, or they cannot be right.
  bool read_index(std::uint32_t connections, std::uint32_t chunks) {
    try {
      std::uint64_t messages = 0;
      std::uint32_t infos = 0;
      for (std::uint64_t place = end_; place < file_.size();) {
        const std::optional<Record> record = record_at(place);
        if (!record) at(place).fail("has an index that ends behind the end of the file");
        const Ros1Head head(record->head, at(place));
        const std::vector<std::byte> content = content_of(*record);
        if (head.kind() == Ros1Kind::connection) take_connection(head, content, place);
        if (head.kind() == Ros1Kind::chunk_info) {
          ++infos;
          RecordFields counts(content, at(place));
          while (!counts.left().empty()) {
            static_cast<void>(counts.number<std::uint32_t>());  // connection
            messages += counts.number<std::uint32_t>();
          }
        }
        place = record->end();
      }
      if (topics_.size() != connections || infos != chunks) return false;
      read_chunk_indexes();
      return entries_.size() == messages;
    } catch (const Error& error) {
      index_damage_ = error.what();
      return false;
    }
  }

  // Behind each chunk is an index of each connection that has messages in it.
  void read_chunk_indexes() {
    std::uint64_t chunk = 0;
    std::size_t first = 0;  // of the chunk's entries
    for_each_record([&](const Record& record, const Ros1Head& head) {
      if (head.kind() == Ros1Kind::chunk) {
        sort_chunk(first);
        first = entries_.size();
        chunk = record.place;
      }
      if (head.kind() != Ros1Kind::index) return;
      const auto connection = head.number<std::uint32_t>("conn");
      expect_connection(connection, record.place);
      const std::vector<std::byte> content = content_of(record);
      if (chunk == 0 || content.size() % ros1_index_entry != 0)
        at(record.place).fail("has an index that cannot be right");
      RecordFields fields(content, at(record.place));
      while (!fields.left().empty()) {
        const std::int64_t nanoseconds = ros1_time(fields.number<std::uint64_t>());
        add({nanoseconds, chunk, fields.number<std::uint32_t>(), connection});
      }
    });
    sort_chunk(first);
  }

  bool closed_ = false;
  std::uint64_t begin_ = 0, end_ = 0;  // of the chunks; behind them is the index, if it was closed
  std::string index_damage_;
};

}  // namespace

std::unique_ptr<BagFile> open_ros1_file(const std::filesystem::path& file) {
  return std::make_unique<Ros1File>(file);
}

}  // namespace palpate
