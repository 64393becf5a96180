// SPDX-License-Identifier: Apache-2.0
#include "palpate/bag/bag_file.hpp"

#include <array>
#include <fstream>

namespace palpate {

std::string BagFile::name(std::string_view topic, std::int64_t id) const {
  return path_.string() + ": message " + std::to_string(id) + " of " + std::string(topic);
}

std::unique_ptr<BagFile> open_bag_file(const std::filesystem::path& file) {
  constexpr std::string_view mcap = "\x89MCAP";
  std::array<char, mcap.size()> begin{};
  std::error_code error;
  if (std::filesystem::is_regular_file(file, error))
    std::ifstream(file, std::ios::binary).read(begin.data(), begin.size());
  if (file.extension() == ".mcap" || std::string_view(begin.data(), begin.size()) == mcap)
    return open_mcap_file(file);
  return open_sqlite_file(file);
}

}  // namespace palpate
