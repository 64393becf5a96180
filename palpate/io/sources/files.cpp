// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/files.hpp"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <system_error>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

constexpr std::string_view digits = "0123456789";

// Cuts the digits that `rest` begins with from it; returns them without leading zeros.
std::string_view take_number(std::string_view& rest) noexcept {
  std::string_view number = rest.substr(0, rest.find_first_not_of(digits));
  rest.remove_prefix(number.size());
  number.remove_prefix(std::min(number.find_first_not_of('0'), number.size()));
  return number;
}

}  // namespace

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
              return natural_less(a.filename().native(), b.filename().native());
            });
  return files;
}

bool natural_less(std::string_view a, std::string_view b) noexcept {
  std::string_view x = a, y = b;
  while (!x.empty() && !y.empty()) {
    const bool x_number = digits.find(x.front()) != std::string_view::npos;
    const bool y_number = digits.find(y.front()) != std::string_view::npos;
    if (x_number && y_number) {
      const std::string_view m = take_number(x), n = take_number(y);
      if (m != n) return m.size() != n.size() ? m.size() < n.size() : m < n;
    } else if (x.front() != y.front()) {
      return x.substr(0, 1) < y.substr(0, 1);
    } else {
      x.remove_prefix(1);
      y.remove_prefix(1);
    }
  }
  return x.empty() && y.empty() ? a < b : x.empty();
}

}  // namespace palpate
