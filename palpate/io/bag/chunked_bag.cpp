// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag/chunked_bag.hpp"

#include <bit>
#include <cerrno>

#include <fcntl.h>
#include <unistd.h>

#include "palpate/io/bag/mcap_format.hpp"

namespace palpate {

static_assert(std::endian::native == std::endian::little, "records are read as they lie in RAM");

std::string BytePlace::text() const { return file.string() + ": byte " + std::to_string(byte); }

void BytePlace::fail(const std::string& why) const { throw Error(text(), why, remedy); }

RandomAccess::RandomAccess(const std::filesystem::path& path) : path_(path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    throw Error(path.string(), "no such file", "check the path");
  descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor_ < 0)
    throw Error(path.string(), std::string("cannot be opened: ") + std::strerror(errno),
                "check its permissions");
  const off_t end = ::lseek(descriptor_, 0, SEEK_END);
  size_ = end < 0 ? 0 : static_cast<std::uint64_t>(end);
}

RandomAccess::~RandomAccess() { ::close(descriptor_); }

void RandomAccess::read(std::uint64_t at, std::span<std::byte> into) const {
  while (!into.empty()) {
    const ssize_t got = ::pread(descriptor_, into.data(), into.size(), static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0)
      throw Error(BytePlace{path_, at, ""}.text(), "cannot be read",
                  "check the disk, and do not change a bag while it is read");
    at += static_cast<std::uint64_t>(got);
    into = into.subspan(static_cast<std::size_t>(got));
  }
}

std::vector<std::byte> RandomAccess::bytes(std::uint64_t at, std::uint64_t size) const {
  std::vector<std::byte> bytes(size);
  read(at, bytes);
  return bytes;
}

std::uint32_t RandomAccess::crc32(std::uint64_t from, std::uint64_t to) const {
  std::vector<std::byte> buffer(std::size_t{1} << 16U);
  std::uint32_t crc = 0;
  while (from < to) {
    const auto part = std::span(buffer).first(std::min<std::uint64_t>(buffer.size(), to - from));
    read(from, part);
    crc = crc32_on(crc, part);
    from += part.size();
  }
  return crc;
}

}  // namespace palpate
