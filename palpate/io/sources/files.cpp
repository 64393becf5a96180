// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/files.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
std::vector<std::byte> read_file(const std::filesystem::path& path, std::uintmax_t max_bytes) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status))
    throw Error(path.string(), "no such file", "check the path");
  // Opening a folder would succeed, and reading a pipe may never end: both are refused.
  if (!std::filesystem::is_regular_file(status))
    throw Error(path.string(), "is not a file", "name a file");
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error)
    throw Error(path.string(), "cannot be read: " + error.message(), "check its permissions");
  if (size > max_bytes)
    throw Error(path.string(),
                "is " + std::to_string(size) + " bytes long, more than the " +
                    std::to_string(max_bytes) + " that are read of such a file",
                "check that it is the right file");
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw Error(path.string(), "cannot be opened: " + std::generic_category().message(errno),
                "check its permissions");
  std::vector<std::byte> bytes(size);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(file.gcount()) != size)
    throw Error(path.string(), "cannot be read to its end", "check the disk and try again");
  return bytes;
}

std::string read_text(const std::filesystem::path& path, std::uintmax_t max_bytes) {
  const std::vector<std::byte> bytes = read_file(path, max_bytes);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder,
                                            std::string_view extension) {
  std::vector<std::filesystem::path> files;
  try {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (lower_case(entry.path().extension().string()) == extension && !entry.is_directory())
        files.push_back(entry.path());
    }
  } catch (const std::filesystem::filesystem_error& error) {
    throw Error(folder.string(), "cannot be listed: " + error.code().message(),
                "check the path and its permissions");
  }
  std::sort(files.begin(), files.end(),
            [](const std::filesystem::path& a, const std::filesystem::path& b) {
              return strverscmp(a.filename().c_str(), b.filename().c_str()) < 0;
            });
  return files;
}

}  // namespace palpate
