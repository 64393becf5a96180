// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "palpate/io/bag/bag_file.hpp"
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
    Statement select(database_, "SELECT data, topic_id FROM messages WHERE id = ?");
    select.bind(0, id);
    if (!select.step())
      throw Error(path().string(), "message " + std::to_string(id) + " is gone",
                  "do not change a bag while it is read");
    const std::span<const std::byte> bytes = select.bytes(0);
    const BagTopic* topic = find(select.integer(1));
    const std::string_view topic_name =
        topic == nullptr ? std::string_view("an unknown topic") : std::string_view(topic->name);
    return {topic_name, {bytes.begin(), bytes.end()}};
  }

  // Others write no checksums: only what SQLite itself cannot read is damage.
  void check(BagCheck& check) override {
    try {
      Statement list(database_, "SELECT data FROM messages ORDER BY id");
      while (list.step()) {
        ++check.messages;
        ++check.unchecked;
      }
    } catch (const Error& error) {
      if (check.damage.empty()) check.damage = error.what();
    }
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
};

}  // namespace

std::unique_ptr<BagFile> open_sqlite_file(const std::filesystem::path& file) {
  return std::make_unique<SqliteFile>(file);
}

}  // namespace palpate
