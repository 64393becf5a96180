// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag/database.hpp"

#include <sqlite3.h>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr int longest_value = 1 << 28;  // [bytes] a message; more is damage

std::string remedy_for(int code) {
  switch (code & 0xff) {
    case SQLITE_FULL:
      return "make room on the disk";
    case SQLITE_IOERR:
      return "check the disk, and that there is room on it";
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return "copy or record it again, it may have been cut short";
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
      return "check that it is there and its folder's permissions";
    default:
      return "check that it is a bag of ROS 2";
  }
}

}  // namespace

void Database::Close::operator()(sqlite3* database) const noexcept {
  sqlite3_close_v2(database);
}

void Statement::Finalize::operator()(sqlite3_stmt* statement) const noexcept {
  sqlite3_finalize(statement);
}

Database::Database(std::filesystem::path file, int flags) : file_(std::move(file)) {
  sqlite3* handle = nullptr;
  const int code = sqlite3_open_v2(file_.c_str(), &handle, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  handle_.reset(handle);
  if (code != SQLITE_OK) fail(code);
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_timeout(handle, 2000);
}

Database Database::create(const std::filesystem::path& file) {
  return {file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE};
}

Database Database::open(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error))
    throw Error(file.string(), "no such file", "check the path");
  Database database(file, SQLITE_OPEN_READONLY);
  sqlite3* handle = database.handle_.get();
  sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, longest_value);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  database.run("PRAGMA cell_size_check = ON");
  return database;
}

void Database::fail(int code) const {
  const bool is_its_own = sqlite3_extended_errcode(handle_.get()) == code;
  const std::string reason = is_its_own ? sqlite3_errmsg(handle_.get()) : sqlite3_errstr(code);
  throw Error(file_.string(), reason, remedy_for(code));
}

void Database::run(const std::string& sql) {
  const int code = sqlite3_exec(handle_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(code);
}

Statement::Statement(const Database& database, std::string_view sql) : database_(&database) {
  sqlite3_stmt* handle = nullptr;
  const int code = sqlite3_prepare_v2(database.handle_.get(), sql.data(),
                                      static_cast<int>(sql.size()), &handle, nullptr);
  handle_.reset(handle);
  check(code);
}

void Statement::check(int code) const {
  if (code != SQLITE_OK) database_->fail(code);
}

void Statement::bind(int parameter, std::int64_t value) {
  check(sqlite3_bind_int64(handle_.get(), parameter + 1, value));
}

void Statement::bind(int parameter, std::string_view text) {
  check(sqlite3_bind_text(handle_.get(), parameter + 1, text.data(), static_cast<int>(text.size()),
                          SQLITE_STATIC));
}

void Statement::bind(int parameter, std::span<const std::byte> bytes) {
  // Without a pointer SQLite would bind NULL.
  const void* data = bytes.empty() ? "" : static_cast<const void*>(bytes.data());
  check(sqlite3_bind_blob64(handle_.get(), parameter + 1, data, bytes.size(), SQLITE_STATIC));
}

bool Statement::step() {
  const int code = sqlite3_step(handle_.get());
  if (code == SQLITE_ROW) return true;
  sqlite3_reset(handle_.get());
  if (code != SQLITE_DONE) database_->fail(code);
  return false;
}

void Statement::run() {
  while (step()) {
  }
}

void Statement::reset() noexcept {
  sqlite3_reset(handle_.get());
}

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(handle_.get(), column);
}

std::string Statement::text(int column) const {
  const unsigned char* text = sqlite3_column_text(handle_.get(), column);
  const int size = sqlite3_column_bytes(handle_.get(), column);
  if (text == nullptr) return {};
  return {reinterpret_cast<const char*>(text), static_cast<std::size_t>(size)};
}

std::span<const std::byte> Statement::bytes(int column) const {
  const void* bytes = sqlite3_column_blob(handle_.get(), column);
  const int size = sqlite3_column_bytes(handle_.get(), column);
  if (bytes == nullptr) return {};
  return {static_cast<const std::byte*>(bytes), static_cast<std::size_t>(size)};
}

}  // namespace palpate
