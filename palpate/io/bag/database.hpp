// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

struct sqlite3;
struct sqlite3_stmt;

namespace palpate {

/// A file of SQLite; closed with the object.
class Database {
 public:
  /// A new file, which must not be there yet. @throws Error
  static Database create(const std::filesystem::path& file);
  /// A file that somebody else wrote: nothing in it is run, nothing is written.
  /// @throws Error if it is not there or not SQLite's.
  static Database open(const std::filesystem::path& file);

  /// Runs SQL without a result. @throws Error
  void run(const std::string& sql);
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  /// What SQLite says of `code`, as an Error about the file.
  [[noreturn]] void fail(int code) const;

 private:
  friend class Statement;
  struct Close {
    void operator()(sqlite3* database) const noexcept;
  };

  Database(std::filesystem::path file, int flags);

  std::filesystem::path file_;
  std::unique_ptr<sqlite3, Close> handle_;
};

/// SQL prepared once and run often. Must not outlive its database. Columns and parameters count
/// from 0; what a getter returns lives until the next step.
class Statement {
 public:
  /// @throws Error
  Statement(const Database& database, std::string_view sql);

  /// `text` and `bytes` must live until the statement has run.
  void bind(int parameter, std::int64_t value);
  void bind(int parameter, std::string_view text);
  void bind(int parameter, std::span<const std::byte> bytes);

  /// The next row, or false after the last, when the statement can be run again. @throws Error
  bool step();
  /// Runs it to its end. @throws Error
  void run();
  /// Can be bound and run again.
  void reset() noexcept;

  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] std::span<const std::byte> bytes(int column) const;

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const noexcept;
  };
  void check(int code) const;

  const Database* database_;
  std::unique_ptr<sqlite3_stmt, Finalize> handle_;
};

}  // namespace palpate
