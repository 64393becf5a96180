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

/// The addresses at which other machines reach a server that listens on `listen`, as they stand in
/// a URL. Of 0.0.0.0 and :: these are the machine's own, that of the default route first; loopback,
/// link-local addresses and interfaces that are down are left out. Empty: there is none.
std::vector<std::string> reachable_addresses(std::string_view listen);

/// A QR code of `text` for a terminal: two modules a character, a quiet zone of four modules, light
/// and dark stated by SGR sequences, lines that end in a line feed. Empty if the text is too long.
std::string qr_code(const std::string& text);

}  // namespace palpate::app
