// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// Files that the operator's page sends to be touched: in a temporary folder that only this account
/// can read, gone with this object. Used on one thread at a time.
class DroppedFiles {
 public:
  static constexpr std::uint64_t usual_limit = 1'000'000'000;  ///< [bytes]
  static constexpr std::size_t longest_name = 100;             ///< [characters]
  /// Of the folder's name, in the system's folder of temporary files.
  static constexpr const char* folder_prefix = "palpate-dropped-";

  /// @param limit  [bytes] of all that is sent while this object lives
  explicit DroppedFiles(std::uint64_t limit = usual_limit) : limit_(limit) {}
  ~DroppedFiles();
  DroppedFiles(const DroppedFiles&) = delete;
  DroppedFiles& operator=(const DroppedFiles&) = delete;

  [[nodiscard]] std::uint64_t limit() const { return limit_; }
  /// Where a file of that name and size goes, which does not exist yet.
  /// @param size  [bytes]
  /// @throws Error for a name that is not of letters, digits, '.', '-' and '_' alone, a kind that
  ///         cannot be touched, no room under the limit or on the disk.
  std::filesystem::path begin(const std::string& name, std::uint64_t size);
  /// The file did not arrive in full: removes it, and does not count it.
  void abandon(const std::filesystem::path& file);

 private:
  struct File {
    std::filesystem::path path;
    std::uint64_t size;
  };

  std::uint64_t limit_;
  std::filesystem::path folder_;  // empty: not made yet
  std::vector<File> files_;
  unsigned count_ = 0;
};

}  // namespace palpate
