// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <optional>

#include <sqlite3.h>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr std::size_t most_sqlite_topics = 10'000;
constexpr int longest_value = 1 << 28;  // [bytes] a message; more is damage

struct Release {
  void operator()(sqlite3* database) const noexcept { sqlite3_close_v2(database); }
  void operator()(sqlite3_stmt* statement) const noexcept { sqlite3_finalize(statement); }
};

// A row of an answer, whose columns count from 0.
struct Row {
  sqlite3_stmt* statement;

  [[nodiscard]] std::int64_t integer(int column) const {
    return sqlite3_column_int64(statement, column);
  }
  [[nodiscard]] std::string text(int column) const {
    const unsigned char* text = sqlite3_column_text(statement, column);
    const int size = sqlite3_column_bytes(statement, column);
    if (text == nullptr) return {};
    return {reinterpret_cast<const char*>(text), static_cast<std::size_t>(size)};
  }
  [[nodiscard]] std::vector<std::byte> bytes(int column) const {
    const auto* bytes = static_cast<const std::byte*>(sqlite3_column_blob(statement, column));
    if (bytes == nullptr) return {};
    return {bytes, bytes + sqlite3_column_bytes(statement, column)};
  }
};

const char* remedy_for(int code) {
  switch (code & 0xff) {
    case SQLITE_IOERR:
      return "check the disk";
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return "copy or record it again, it may have been cut short";
    case SQLITE_CANTOPEN:
      return "check that it is there and its folder's permissions";
    default:
      return "check that it is a bag of ROS 2";
  }
}

// Nothing in the file is run, and nothing is written.
class SqliteFile final : public BagFile {
 public:
  explicit SqliteFile(const std::filesystem::path& file) : BagFile(file) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error))
      throw Error(file.string(), "no such file", "check the path");
    sqlite3* opened = nullptr;
    const int code =
        sqlite3_open_v2(file.c_str(), &opened, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX, nullptr);
    database_.reset(opened);
    check(code);
    sqlite3_extended_result_codes(opened, 1);
    sqlite3_busy_timeout(opened, 2000);
    sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, longest_value);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    for_each_row("PRAGMA cell_size_check = ON", 0, [](const Row&) {});
    for (const std::string table : {"topics", "messages"}) expect_table(table);
    for_each_row("SELECT id, name, type FROM topics ORDER BY id", 0, [&](const Row& row) {
      topics_.emplace_back(BagTopic{row.text(1), row.text(2)}, row.integer(0));
      if (topics_.size() > most_sqlite_topics)
        throw Error(file.string(), "has too many topics", "it may be damaged");
    });
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
      for_each_row("SELECT id, timestamp FROM messages WHERE topic_id = ? ORDER BY id", number,
                   [&](const Row& row) {
                     messages.push_back({row.integer(0), row.integer(1)});
                   });
    }
    return messages;
  }

  [[nodiscard]] Content read(std::int64_t id) override {
    std::optional<Content> content;
    for_each_row("SELECT data, topic_id FROM messages WHERE id = ?", id, [&](const Row& row) {
      const auto topic = std::find_if(topics_.begin(), topics_.end(), [&](const auto& each) {
        return each.second == row.integer(1);
      });
      content = {topic == topics_.end() ? std::string_view("an unknown topic")
                                        : std::string_view(topic->first.name),
                 row.bytes(0)};
    });
    if (content) return *std::move(content);
    throw Error(path().string(), "message " + std::to_string(id) + " is gone",
                "do not change a bag while it is read");
  }

  // Others write no checksums: only what SQLite itself cannot read is damage.
  void check(BagCheck& check) override {
    try {
      for_each_row("SELECT data FROM messages ORDER BY id", 0, [&](const Row&) {
        ++check.messages;
        ++check.unchecked;
      });
    } catch (const Error& error) {
      if (check.damage.empty()) check.damage = error.what();
    }
  }

 private:
  // A view of that name could compute for ever.
  void expect_table(const std::string& name) const {
    bool is_table = false;
    for_each_row("SELECT type FROM sqlite_master WHERE name = '" + name + "'", 0,
                 [&](const Row& row) { is_table = row.text(0) == "table"; });
    if (!is_table) throw Error(path().string(), "has no table of " + name, "name a bag of ROS 2");
  }

  // @param value  of the statement's '?', if it has one
  template <class Use>
  void for_each_row(const std::string& sql, std::int64_t value, const Use& use) const {
    sqlite3_stmt* made = nullptr;
    check(sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &made, nullptr));
    const std::unique_ptr<sqlite3_stmt, Release> statement(made);
    if (sqlite3_bind_parameter_count(made) > 0) check(sqlite3_bind_int64(made, 1, value));
    int code = sqlite3_step(made);
    for (; code == SQLITE_ROW; code = sqlite3_step(made)) use(Row{made});
    if (code != SQLITE_DONE) check(code);
  }

  // @throws Error with what SQLite says of a code
  void check(int code) const {
    if (code == SQLITE_OK) return;
    const bool is_its_own = sqlite3_extended_errcode(database_.get()) == code;
    throw Error(path().string(),
                is_its_own ? sqlite3_errmsg(database_.get()) : sqlite3_errstr(code),
                remedy_for(code));
  }

  std::unique_ptr<sqlite3, Release> database_;
  // With a topic's number in this file; not the same in all files of a bag.
  std::vector<std::pair<BagTopic, std::int64_t>> topics_;
};

}  // namespace

std::unique_ptr<BagFile> open_sqlite_file(const std::filesystem::path& file) {
  return std::make_unique<SqliteFile>(file);
}

}  // namespace palpate
