// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::app {

/// Files and folders that sessions with a page touched, the newest first. They are kept from one
/// run of the program to the next, in `palpate/opened` of $XDG_STATE_HOME (~/.local/state); where
/// that cannot be written, in memory alone.
class OpenedScenes {
 public:
  static constexpr std::size_t most = 8;

  /// Reads what former runs left. @param temporary  whatever lies in it is not kept after this run
  explicit OpenedScenes(std::filesystem::path temporary = {});

  /// Remembers a source's URI with its path made absolute; leaves out what names no file.
  void add(std::string_view uri);
  /// It could not be opened after all.
  void remove(std::string_view uri);
  /// Those that are still there.
  [[nodiscard]] std::vector<std::string> uris() const;

 private:
  void save() const;

  std::filesystem::path temporary_;
  std::filesystem::path file_;  // empty: there is no place for it
  std::vector<std::string> uris_;
};

/// The URI with an absolute path; empty if it names no file or folder. @throws Error as Uri
std::string absolute_uri(std::string_view uri);

}  // namespace palpate::app
