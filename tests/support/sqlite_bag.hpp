// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/io/bag/checksum.hpp"
#include "palpate/io/bag/database.hpp"

namespace palpate::test {

/// Writes a file of SQLite with checksums, as palpate's recordings were before they were MCAP.
class SqliteBagWriter {
 public:
  explicit SqliteBagWriter(const std::filesystem::path& file) : database_(Database::create(file)) {
    database_.run(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,"
        "timestamp INTEGER NOT NULL,data BLOB NOT NULL);"
        "CREATE TABLE palpate_checksums(id INTEGER PRIMARY KEY,first INTEGER NOT NULL,"
        "closed INTEGER NOT NULL,crc32 BLOB NOT NULL,chain INTEGER NOT NULL)");
  }

  std::size_t topic(const std::string& name, std::string_view type) {
    Statement insert(database_, "INSERT INTO topics(name,type) VALUES(?,?)");
    insert.bind(0, name);
    insert.bind(1, type);
    insert.run();
    topics_.emplace_back(name, type);
    return topics_.size() - 1;
  }
  void write(std::size_t topic, std::int64_t nanoseconds, std::span<const std::byte> message) {
    Statement insert(database_, "INSERT INTO messages(topic_id,timestamp,data) VALUES(?,?,?)");
    insert.bind(0, static_cast<std::int64_t>(topic + 1));
    insert.bind(1, nanoseconds);
    insert.bind(2, message);
    insert.run();
    const auto& [name, type] = topics_[topic];
    block_.messages.push_back(checksum_of(name, type, nanoseconds, message));
  }
  void commit(bool closed = false) {
    block_.closed = closed;
    chain_ = chained(chain_, block_);
    Statement insert(database_,
                     "INSERT INTO palpate_checksums(first,closed,crc32,chain) VALUES(?,?,?,?)");
    insert.bind(0, block_.first);
    insert.bind(1, std::int64_t{closed});
    insert.bind(2, std::as_bytes(std::span(block_.messages)));
    insert.bind(3, std::int64_t{chain_});
    insert.run();
    block_.first += static_cast<std::int64_t>(block_.messages.size());
    block_.messages.clear();
  }

 private:
  Database database_;
  std::vector<std::pair<std::string, std::string>> topics_;
  ChecksumBlock block_;
  std::uint32_t chain_ = 0;
};

}  // namespace palpate::test
