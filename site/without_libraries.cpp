// SPDX-License-Identifier: Apache-2.0
// In place of the files that need SQLite, zstd, lz4 and bzip2: what they read is refused in
// one sentence, but for zstd, which the page's JavaScript decodes. There are no drivers, either.
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "palpate/drivers/drivers.hpp"
#include "palpate/io/bag/bag_writer.hpp"
#include "palpate/io/bag/compression.hpp"
#include "palpate/io/bag/database.hpp"
#include "palpate/kernel/core/error.hpp"

#include "site/page.hpp"

namespace palpate {
namespace {

[[noreturn]] void refuse(const std::string& name, const std::string& what) {
  throw Error(name, what + ", which this page cannot read or write", "use the program palpate");
}

}  // namespace

std::vector<Driver> listed_drivers() {
  return {};
}

bool is_zstd(std::span<const std::byte> bytes) noexcept {
  constexpr unsigned char magic[] = {0x28, 0xb5, 0x2f, 0xfd};
  return bytes.size() >= sizeof magic && std::memcmp(bytes.data(), magic, sizeof magic) == 0;
}

std::vector<std::byte> decompress_zstd(std::span<const std::byte> packed, std::size_t max_bytes,
                                       const std::string& name) {
  std::vector<std::byte> bytes = site::unpack_zstd(packed, max_bytes);
  if (bytes.empty() && !packed.empty())
    throw Error(name, "its zstd data are damaged, or hold more than is declared",
                "record or download it again");
  return bytes;
}

std::vector<std::byte> decompress_lz4(std::span<const std::byte> /*packed*/,
                                      std::size_t /*max_bytes*/, const std::string& name) {
  refuse(name, "it is compressed with lz4");
}

std::vector<std::byte> decompress_bz2(std::span<const std::byte> /*packed*/,
                                      std::size_t /*max_bytes*/, const std::string& name) {
  refuse(name, "it is compressed with bzip2");
}

void Database::Close::operator()(sqlite3* /*database*/) const noexcept {}
void Statement::Finalize::operator()(sqlite3_stmt* /*statement*/) const noexcept {}

Database Database::create(const std::filesystem::path& file) {
  refuse(file.string(), "it is to be a database of SQLite");
}
Database Database::open(const std::filesystem::path& file) {
  refuse(file.string(), "it is a database of SQLite");
}
void Database::run(const std::string& /*sql*/) {}

// There is no database, so there is no statement.
Statement::Statement(const Database& database, std::string_view /*sql*/) : database_(&database) {
  refuse(database.file().string(), "it is a database of SQLite");
}
void Statement::bind(int /*parameter*/, std::int64_t /*value*/) {}
void Statement::bind(int /*parameter*/, std::string_view /*text*/) {}
void Statement::bind(int /*parameter*/, std::span<const std::byte> /*bytes*/) {}
bool Statement::step() {
  return false;
}
void Statement::run() {}
void Statement::reset() noexcept {}
std::int64_t Statement::integer(int /*column*/) const {
  return 0;
}
std::string Statement::text(int /*column*/) const {
  return {};
}
std::span<const std::byte> Statement::bytes(int /*column*/) const {
  return {};
}

}  // namespace palpate
