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
  constexpr std::string_view ros1 = "#ROSBAG";
  constexpr std::string_view sqlite = "SQLite";
  std::array<char, ros1.size()> begin{};
  std::error_code error;
  if (std::filesystem::is_regular_file(file, error))
    std::ifstream(file, std::ios::binary).read(begin.data(), begin.size());
  const std::string_view text(begin.data(), begin.size());
  if (text.starts_with(mcap) || file.extension() == ".mcap") return open_mcap_file(file);
  const bool is_named_bag = file.extension() == ".bag" && !text.starts_with(sqlite);
  if (text.starts_with(ros1) || is_named_bag) return open_ros1_file(file);
  return open_sqlite_file(file);
}

}  // namespace palpate
