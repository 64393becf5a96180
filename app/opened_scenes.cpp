// SPDX-License-Identifier: Apache-2.0
#include "app/opened_scenes.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <system_error>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate::app {
namespace {

namespace fs = std::filesystem;

fs::path state_file() {
  const char* state = std::getenv("XDG_STATE_HOME");
  if (state != nullptr && *state == '/') return fs::path(state) / "palpate/opened";
  const char* home = std::getenv("HOME");
  if (home != nullptr && *home == '/') return fs::path(home) / ".local/state/palpate/opened";
  return {};
}

bool is_within(const fs::path& file, const fs::path& folder) {
  return !folder.empty() && file.string().rfind(folder.string(), 0) == 0;
}

}  // namespace

std::string absolute_uri(std::string_view text) {
  const Uri uri(text);
  const std::array<std::string_view, 5> of_files = {"tum", "depth", "pcd", "ply", "recording"};
  if (std::find(of_files.begin(), of_files.end(), uri.scheme()) == of_files.end()) return {};
  std::error_code error;
  const fs::path path = fs::absolute(uri.path(), error).lexically_normal();
  if (error || uri.path().empty()) return {};
  const std::string_view options = text.substr(uri.scheme().size() + 1 + uri.path().size());
  return uri.scheme() + ":" + path.string() + std::string(options);
}

OpenedScenes::OpenedScenes(fs::path temporary)
    : temporary_(std::move(temporary)), file_(state_file()) {
  std::ifstream in(file_);
  for (std::string line; uris_.size() < most && std::getline(in, line);) {
    try {
      if (absolute_uri(line) == line) uris_.push_back(line);
    } catch (const Error&) {  // somebody else's line
      continue;
    }
  }
}

void OpenedScenes::add(std::string_view uri) {
  const std::string absolute = absolute_uri(uri);
  if (absolute.empty()) return;
  std::erase(uris_, absolute);
  uris_.insert(uris_.begin(), absolute);
  if (uris_.size() > most) uris_.resize(most);
  save();
}

void OpenedScenes::remove(std::string_view uri) {
  if (std::erase(uris_, absolute_uri(uri)) > 0) save();
}

std::vector<std::string> OpenedScenes::uris() const {
  std::vector<std::string> there;
  std::error_code unused;
  for (const std::string& uri : uris_) {
    if (fs::exists(Uri(uri).path(), unused)) there.push_back(uri);
  }
  return there;
}

void OpenedScenes::save() const {
  if (file_.empty()) return;
  std::error_code error;
  fs::create_directories(file_.parent_path(), error);
  const fs::path written = file_.string() + "~";
  std::ofstream out(written);
  for (const std::string& uri : uris_) {
    if (!is_within(Uri(uri).path(), temporary_)) out << uri << '\n';
  }
  out.close();
  if (out) fs::rename(written, file_, error);
}

}  // namespace palpate::app
