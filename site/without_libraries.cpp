// SPDX-License-Identifier: Apache-2.0
// In place of the files that need SQLite, zstd, lz4, bzip2 and zlib: what they read is refused in
// one sentence, but for zstd and gzip, which the page's JavaScript decodes. There are no drivers,
// either.
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "palpate/drivers/drivers.hpp"
#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/bag/compression.hpp"
#include "palpate/kernel/core/error.hpp"

#include "site/page.hpp"

namespace palpate {
namespace {

[[noreturn]] void refuse(const std::string& name, const std::string& what) {
  throw Error(name, what + ", which this page cannot read or write", "use the program palpate");
}

}  // namespace

std::vector<Driver> listed_drivers() { return {}; }

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

std::vector<std::byte> decompress_gzip(std::span<const std::byte> packed, std::size_t max_bytes,
                                       const std::string& name) {
  std::vector<std::byte> bytes = site::unpack_gzip(packed, max_bytes);
  if (bytes.empty())
    throw Error(name, "it is no gzip, or a damaged one, or holds more than is declared",
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

std::unique_ptr<BagFile> open_sqlite_file(const std::filesystem::path& file) {
  refuse(file.string(), "it is a database of SQLite");
}

}  // namespace palpate
