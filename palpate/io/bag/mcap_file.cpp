// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/io/bag/chunked_bag.hpp"
#include "palpate/io/bag/mcap_format.hpp"

namespace palpate {
namespace {

constexpr std::size_t footer_content = 20;  // [bytes]
constexpr const char* mcap_remedy = "copy it again, or save the undamaged part with mcap recover";

class McapFile final : public ChunkedBag {
 public:
  explicit McapFile(const std::filesystem::path& path)
      : ChunkedBag(path, mcap_remedy, "ros2 bag convert") {
    if (file_.size() < mcap_magic.size() || !is_magic(0))
      throw Error(path.string(), "is not an MCAP file", "name a bag of ROS 2");
    find_footer();
    if (read_index()) return;
    entries_.clear();
    topics_.clear();
    schemas_.clear();
    Walked walked;
    walk(walked, false, [this](const Entry& entry) { add(entry); });
  }

  [[nodiscard]] Content read(std::int64_t id) override {
    const Entry& entry = entries_.at(static_cast<std::size_t>(id - 1));
    const BytePlace place = at(entry.record);
    std::vector<std::byte> alone;
    std::span<const std::byte> content;
    RecordKind kind = RecordKind::none;
    if (entry.offset == in_no_chunk) {
      const std::optional<Record> record = record_at(entry.record);
      if (record) {
        kind = record->kind;
        alone = content_of(*record);
        content = alone;
      }
    } else {
      const std::span<const std::byte> records = chunk_at(entry.record);
      if (entry.offset > records.size()) place.fail("has a chunk that ends before its index says");
      const Inner inner = inner_at(records, entry.offset, place);
      kind = inner.kind;
      content = inner.content;
    }
    if (kind != RecordKind::message) place.fail("has no message where its index names one");
    entry_of(content, entry.record, entry.offset).expect(entry, place);
    content = content.subspan(message_head);
    return {topics_.at(entry.topic).name, {content.begin(), content.end()}};
  }

  void check(BagCheck& check) override {
    check.closed = check.closed && closed_;
    Walked walked;
    std::string damage;
    try {
      walk(walked, true, [](const Entry& /*entry*/) {});
      if (walked.data_crc != 0 && file_.crc32(0, walked.data_end) != walked.data_crc)
        at(walked.data_end).fail("ends data that are not what their checksum says");
      damage = summary_damage_;
    } catch (const Error& error) {
      damage = error.what();
    }
    if (check.damage.empty()) check.damage = damage;
    const bool all = walked.data_crc != 0;
    check.has_checksums = check.has_checksums || all || walked.covered > 0;
    check.messages += walked.messages;
    if (!all) check.unchecked += walked.messages - walked.covered;
  }

 private:
  // A record of the file, outside of chunks.
  struct Record {
    RecordKind kind;
    std::uint64_t place, begin, size;  // of its head; of its content

    [[nodiscard]] std::uint64_t end() const { return begin + size; }
  };
  // One within a chunk.
  struct Inner {
    RecordKind kind;
    std::span<const std::byte> content;
  };
  struct Walked {
    std::uint64_t messages = 0;
    std::uint64_t covered = 0;  // of these, in chunks with a checksum
    std::uint64_t data_end = 0;
    std::uint32_t data_crc = 0;  // 0: none
  };
  struct Statistics {
    std::uint64_t messages, chunks;
  };
  struct ChunkIndex {
    std::uint64_t begin, indexes, indexes_size;
  };

  [[nodiscard]] bool is_magic(std::uint64_t place) const {
    std::array<char, mcap_magic.size()> bytes{};
    file_.read(place, std::as_writable_bytes(std::span(bytes)));
    return std::string_view(bytes.data(), bytes.size()) == mcap_magic;
  }

  // A file that was closed ends with a footer and the magic.
  void find_footer() {
    end_ = file_.size();
    const std::uint64_t size = record_head + footer_content + mcap_magic.size();
    if (file_.size() < mcap_magic.size() + size || !is_magic(file_.size() - mcap_magic.size()))
      return;
    const std::optional<Record> footer = record_at(file_.size() - size);
    if (!footer || footer->kind != RecordKind::footer || footer->size != footer_content) return;
    const std::vector<std::byte> content = content_of(*footer);
    RecordFields fields(content, at(footer->place));
    closed_ = true;
    end_ = footer->place;
    summary_ = fields.number<std::uint64_t>();
    if (summary_ == 0) summary_ = end_;
    static_cast<void>(fields.number<std::uint64_t>());  // offsets of the summary's groups
    summary_crc_ = fields.number<std::uint32_t>();
  }

  // None where the file, or its part before the footer, ends before the record does.
  [[nodiscard]] std::optional<Record> record_at(std::uint64_t place) const {
    if (place > end_ || end_ - place < record_head) return std::nullopt;
    std::array<std::byte, record_head> head{};
    file_.read(place, head);
    RecordFields fields(head, at(place));
    const auto kind = static_cast<RecordKind>(fields.number<std::uint8_t>());
    const auto size = fields.number<std::uint64_t>();
    if (size > end_ - place - record_head) return std::nullopt;
    return Record{kind, place, place + record_head, size};
  }

  static Inner inner_at(std::span<const std::byte> records, std::size_t offset,
                        const BytePlace& place) {
    RecordFields fields(records.subspan(offset), place);
    const auto kind = static_cast<RecordKind>(fields.number<std::uint8_t>());
    return {kind, fields.take(fields.number<std::uint64_t>())};
  }

  [[nodiscard]] Entry entry_of(std::span<const std::byte> message, std::uint64_t record,
                               std::uint32_t offset) const {
    RecordFields fields(message, at(record));
    const auto channel = fields.number<std::uint16_t>();
    static_cast<void>(fields.number<std::uint32_t>());  // sequence
    const auto logged = static_cast<std::int64_t>(fields.number<std::uint64_t>());
    static_cast<void>(fields.number<std::uint64_t>());  // when it was published
    if (!topics_.contains(channel))
      at(record).fail("has a message of channel " + std::to_string(channel) +
                      ", which is not declared in the file");
    return {logged, record, offset, channel};
  }

  // The records of the chunk there, decompressed and checked; they live until the next is asked
  // for.
  std::span<const std::byte> chunk_at(std::uint64_t place) {
    if (chunk_place_ == place) return chunk_;
    chunk_place_ = 0;
    const std::optional<Record> record = record_at(place);
    if (!record || record->kind != RecordKind::chunk)
      at(place).fail("has no chunk where its index names one");
    const std::vector<std::byte> content = content_of(*record);
    RecordFields fields(content, at(place));
    static_cast<void>(fields.take(2 * sizeof(std::uint64_t)));  // first and last time
    const auto size = fields.number<std::uint64_t>();
    const auto crc = fields.number<std::uint32_t>();
    const std::string compression = fields.text();
    unpack(compression, fields.take(fields.number<std::uint64_t>()), size, place);
    if (crc != 0 && crc32_on(0, chunk_) != crc)
      at(place).fail("has a chunk that is not what its checksum says");
    chunk_place_ = place;
    chunk_has_crc_ = crc != 0;
    return chunk_;
  }

  // Reads the file from its begin to the end of its data, and calls take(Entry) for each message.
  // @param thorough  compares the checksums of attachments, too
  template <class Take>
  void walk(Walked& walked, bool thorough, const Take& take) {
    std::uint64_t place = mcap_magic.size();
    for (;;) {
      const std::optional<Record> record = record_at(place);
      if (!record || (!closed_ && record->kind == RecordKind::none)) {
        // One that was killed, or whose machine lost power, ends here.
        if (closed_) at(place).fail("has a record that ends behind the end of the file");
        return;
      }
      switch (record->kind) {
        case RecordKind::none:
          at(place).fail("has a record of no kind");
        case RecordKind::schema:
        case RecordKind::channel: {
          const std::vector<std::byte> content = content_of(*record);
          take_definition({record->kind, content}, place);
          break;
        }
        case RecordKind::message: {
          if (record->size < message_head)
            at(place).fail("has a message that is shorter than its fields");
          std::array<std::byte, message_head> head{};
          file_.read(record->begin, head);
          ++walked.messages;
          take(entry_of(head, place, in_no_chunk));
          break;
        }
        case RecordKind::chunk:
          walk_chunk(walked, place, take);
          break;
        case RecordKind::attachment:
          if (thorough) check_attachment(*record);
          break;
        case RecordKind::data_end: {
          const std::vector<std::byte> content = content_of(*record);
          walked.data_end = place;
          walked.data_crc = RecordFields(content, at(place)).number<std::uint32_t>();
          if (closed_ && record->end() != summary_)
            at(place).fail("has a gap between its data and its summary");
          expect_all(walked);
          return;
        }
        default:
          break;  // indexes, metadata, what later versions have
      }
      place = record->end();
    }
  }

  template <class Take>
  void walk_chunk(Walked& walked, std::uint64_t place, const Take& take) {
    const std::span<const std::byte> records = chunk_at(place);
    for (std::size_t offset = 0; offset < records.size();) {
      const Inner inner = inner_at(records, offset, at(place));
      take_definition(inner, place);
      if (inner.kind == RecordKind::message) {
        ++walked.messages;
        if (chunk_has_crc_) ++walked.covered;
        take(entry_of(inner.content, place, static_cast<std::uint32_t>(offset)));
      }
      offset += record_head + inner.content.size();
    }
  }

  // Of a schema or a channel; others are passed over.
  void take_definition(const Inner& record, std::uint64_t place) {
    if (record.kind != RecordKind::schema && record.kind != RecordKind::channel) return;
    RecordFields fields(record.content, at(place));
    const auto number = fields.number<std::uint16_t>();
    if (record.kind == RecordKind::schema) {
      schemas_.emplace(number, fields.text());
      return;
    }
    const auto schema = schemas_.find(fields.number<std::uint16_t>());
    BagTopic topic{.name = fields.text(), .type = {}};
    if (schema != schemas_.end()) topic.type = schema->second;
    topics_.emplace(number, std::move(topic));
  }

  void check_attachment(const Record& record) const {
    std::uint32_t crc = 0;
    if (record.size < sizeof crc) at(record.place).fail("has an attachment of no size");
    const std::uint64_t end = record.end() - sizeof crc;
    file_.read(end, std::as_writable_bytes(std::span(&crc, 1)));
    if (crc != 0 && file_.crc32(record.begin, end) != crc)
      at(record.place).fail("has an attachment that is not what its checksum says");
  }

  // Are as many messages there as the statistics say?
  void expect_all(const Walked& walked) const {
    if (statistics_ && walked.messages != statistics_->messages)
      throw Error(path().string(),
                  "has " + std::to_string(walked.messages) + " messages, but says " +
                      std::to_string(statistics_->messages),
                  mcap_remedy);
  }

  // Takes the messages' places from the file's own indexes. False where it has none for all of its
  // messages, or they cannot be right.
  bool read_index() {
    if (!closed_) return false;
    try {
      std::vector<ChunkIndex> chunks = read_summary();
      if (!statistics_ || statistics_->chunks != chunks.size()) return false;
      std::sort(chunks.begin(), chunks.end(),
                [](const ChunkIndex& a, const ChunkIndex& b) { return a.begin < b.begin; });
      for (const ChunkIndex& chunk : chunks) {
        if (!read_message_indexes(chunk)) return false;
      }
      return entries_.size() == statistics_->messages;
    } catch (const Error& error) {
      summary_damage_ = error.what();
      return false;
    }
  }

  // Its definitions and statistics go where they belong. @return where its chunks are
  std::vector<ChunkIndex> read_summary() {
    if (summary_ < mcap_magic.size() || summary_ > end_)
      at(end_).fail("has a summary outside of the file");
    constexpr std::size_t footer_before_crc = record_head + footer_content - sizeof summary_crc_;
    if (summary_crc_ != 0 && file_.crc32(summary_, end_ + footer_before_crc) != summary_crc_)
      at(summary_).fail("has a summary that is not what its checksum says");
    std::vector<ChunkIndex> chunks;
    std::optional<Statistics> statistics;
    for (std::uint64_t place = summary_; place < end_;) {
      const std::optional<Record> record = record_at(place);
      if (!record) at(place).fail("has a record that ends behind the end of the summary");
      if (record->kind == RecordKind::schema || record->kind == RecordKind::channel ||
          record->kind == RecordKind::chunk_index || record->kind == RecordKind::statistics) {
        const std::vector<std::byte> content = content_of(*record);
        take_definition({record->kind, content}, place);
        RecordFields fields(content, at(place));
        if (record->kind == RecordKind::chunk_index) chunks.push_back(chunk_index(fields, place));
        if (record->kind == RecordKind::statistics) {
          statistics.emplace().messages = fields.number<std::uint64_t>();
          static_cast<void>(fields.take(14));  // how many schemas, channels, attachments, metadata
          statistics->chunks = fields.number<std::uint32_t>();
        }
      }
      place = record->end();
    }
    statistics_ = statistics;
    return chunks;
  }

  [[nodiscard]] ChunkIndex chunk_index(RecordFields fields, std::uint64_t place) const {
    static_cast<void>(fields.take(2 * sizeof(std::uint64_t)));  // first and last time
    const auto begin = fields.number<std::uint64_t>();
    const auto size = fields.number<std::uint64_t>();
    static_cast<void>(fields.block());  // where each channel's index is
    const auto indexes_size = fields.number<std::uint64_t>();
    if (begin == 0 || begin > end_ || size > end_ - begin || indexes_size > end_ - begin - size ||
        indexes_size > largest_record)
      at(place).fail("has an index of a chunk outside of the file");
    return {begin, begin + size, indexes_size};
  }

  bool read_message_indexes(const ChunkIndex& chunk) {
    const std::vector<std::byte> indexes = file_.bytes(chunk.indexes, chunk.indexes_size);
    const std::size_t first = entries_.size();
    for (std::size_t offset = 0; offset < indexes.size();) {
      const Inner inner = inner_at(indexes, offset, at(chunk.indexes));
      offset += record_head + inner.content.size();
      if (inner.kind != RecordKind::message_index) return false;
      RecordFields fields(inner.content, at(chunk.indexes));
      const auto channel = fields.number<std::uint16_t>();
      RecordFields places(fields.block(), at(chunk.indexes));
      while (!places.left().empty()) {
        const auto logged = static_cast<std::int64_t>(places.number<std::uint64_t>());
        const auto where = places.number<std::uint64_t>();
        if (where >= in_no_chunk || !topics_.contains(channel) ||
            entries_.size() == statistics_->messages)
          return false;
        add({logged, chunk.begin, static_cast<std::uint32_t>(where), channel});
      }
    }
    sort_chunk(first);
    return true;
  }

  bool closed_ = false;
  std::uint64_t end_ = 0;          // of the records: where the footer begins, or the file ends
  std::uint64_t summary_ = 0;      // where it begins; `end_` without one
  std::uint32_t summary_crc_ = 0;  // 0: none
  std::string summary_damage_;
  std::optional<Statistics> statistics_;
  std::map<std::uint16_t, std::string> schemas_;
  bool chunk_has_crc_ = false;  // of the chunk that was read last
};

}  // namespace

std::unique_ptr<BagFile> open_mcap_file(const std::filesystem::path& file) {
  return std::make_unique<McapFile>(file);
}

}  // namespace palpate
