// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "palpate/io/bag/bag_file.hpp"
#include "palpate/io/bag/checksum.hpp"
#include "palpate/io/bag/database.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr std::size_t most_sqlite_topics = 10'000;

// A view of that name could compute for ever.
void expect_table(const Database& database, const std::string& name) {
  Statement look(database, "SELECT type FROM sqlite_master WHERE name = ?");
  look.bind(0, name);
  if (!look.step() || look.text(0) != "table")
    throw Error(database.file().string(), "has no table of " + name, "name a bag of ROS 2");
}

class SqliteFile final : public BagFile {
 public:
  explicit SqliteFile(const std::filesystem::path& file)
      : BagFile(file), database_(Database::open(file)) {
    expect_table(database_, "topics");
    expect_table(database_, "messages");
    Statement list(database_, "SELECT id, name, type FROM topics ORDER BY id");
    while (list.step()) {
      topics_.emplace_back(BagTopic{list.text(1), list.text(2)}, list.integer(0));
      if (topics_.size() > most_sqlite_topics)
        throw Error(file.string(), "has too many topics", "it may be damaged");
    }
    checksums_ = read_checksums(database_);
  }

  [[nodiscard]] std::vector<BagTopic> topics() const override {
    std::vector<BagTopic> topics;
    for (const auto& [topic, number] : topics_) topics.push_back(topic);
    return topics;
  }

  [[nodiscard]] std::vector<Message> messages(std::string_view topic) override {
    std::vector<Message> messages;
    for (const auto& [each, number] : topics_) {
      if (each.name != topic) continue;
      Statement list(database_,
                     "SELECT id, timestamp FROM messages WHERE topic_id = ? ORDER BY id");
      list.bind(0, number);
      while (list.step()) messages.push_back({list.integer(0), list.integer(1)});
    }
    return messages;
  }

  [[nodiscard]] Content read(std::int64_t id) override {
    Statement select(database_, "SELECT data, topic_id, timestamp FROM messages WHERE id = ?");
    select.bind(0, id);
    if (!select.step())
      throw Error(path().string(), "message " + std::to_string(id) + " is gone",
                  "do not change a bag while it is read");
    const std::span<const std::byte> bytes = select.bytes(0);
    const BagTopic* topic = find(select.integer(1));
    const std::string_view topic_name =
        topic == nullptr ? std::string_view("an unknown topic") : std::string_view(topic->name);
    if (const std::uint32_t* expected = checksums_.find(id);
        expected != nullptr &&
        (topic == nullptr ||
         checksum_of(topic->name, topic->type, select.integer(2), bytes) != *expected))
      throw Error(name(topic_name, id), "is not what its checksum says",
                  "it is damaged; what was recorded before it can be used");
    return {topic_name, {bytes.begin(), bytes.end()}};
  }

  void check(BagCheck& check) override {
    const auto damaged = [&](const std::string& what) {
      if (check.damage.empty()) check.damage = path().string() + ": " + what;
    };
    std::int64_t expected = 1;  // the next message's id
    std::int64_t covered = 0;   // the last id that has a checksum
    bool closed = !checksums_.there;
    if (!checksums_.blocks.empty()) {
      const ChecksumBlock& last = checksums_.blocks.back();
      covered = last.first + static_cast<std::int64_t>(last.messages.size()) - 1;
      closed = last.closed;
    }
    check.has_checksums = check.has_checksums || checksums_.there;
    check.closed = check.closed && closed;
    try {
      Statement list(database_, "SELECT id, topic_id, timestamp, data FROM messages ORDER BY id");
      while (list.step()) {
        ++check.messages;
        const std::int64_t id = list.integer(0);
        const std::uint32_t* checksum = checksums_.find(id);
        if (checksum == nullptr) {
          ++check.unchecked;
          continue;
        }
        if (id != expected) damaged("message " + std::to_string(expected) + " is missing");
        expected = id + 1;
        const BagTopic* topic = find(list.integer(1));
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
    if (!checksums_.damage.empty()) damaged(checksums_.damage);
  }

 private:
  [[nodiscard]] const BagTopic* find(std::int64_t number) const {
    const auto topic = std::find_if(topics_.begin(), topics_.end(),
                                    [&](const auto& each) { return each.second == number; });
    return topic == topics_.end() ? nullptr : &topic->first;
  }

  Database database_;
  // With a topic's number in this file; not the same in all files of a bag.
  std::vector<std::pair<BagTopic, std::int64_t>> topics_;
  Checksums checksums_;
};

}  // namespace

std::unique_ptr<BagFile> open_sqlite_file(const std::filesystem::path& file) {
  return std::make_unique<SqliteFile>(file);
}

}  // namespace palpate
