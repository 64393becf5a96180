// SPDX-License-Identifier: Apache-2.0
#include "palpate/viewer/dropped_files.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <system_error>

#include "palpate/core/error.hpp"
#include "palpate/sources/source.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t keep_free = 100'000'000;  // [bytes] of the disk

bool is_simple_name(const std::string& name) {
  return !name.empty() && name.size() <= DroppedFiles::longest_name && name.front() != '.' &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '.' || c == '-' || c == '_';
         });
}

std::string megabytes(std::uint64_t bytes) {
  return std::to_string((bytes + 999'999) / 1'000'000) + " MB";
}

fs::path make_folder() {
  std::string name = (fs::temp_directory_path() / DroppedFiles::folder_prefix).string() + "XXXXXX";
  if (mkdtemp(name.data()) == nullptr)
    throw Error(name, "cannot be made", "set TMPDIR to a folder that can be written");
  return name;
}

}  // namespace

DroppedFiles::~DroppedFiles() {
  std::error_code unused;
  if (!folder_.empty()) fs::remove_all(folder_, unused);
}

fs::path DroppedFiles::begin(const std::string& name, std::uint64_t size) {
  if (!is_simple_name(name))
    throw Error("file", "its name is too long, or has other characters than letters and digits",
                "rename it");
  static_cast<void>(uri_of_file(name));  // refuses other kinds
  std::uint64_t sum = size;
  for (const File& file : files_) sum += file.size;
  if (size > limit_ || sum > limit_)
    throw Error(
        name,
        "is of " + megabytes(size) + ", and the page may send " + megabytes(limit_) + " in all",
        "start the program with --camera and the file's path");
  if (folder_.empty()) folder_ = make_folder();
  std::error_code error;
  const fs::space_info space = fs::space(folder_, error);
  if (!error && space.available < size + keep_free)
    throw Error(folder_.string(), "has no room for " + megabytes(size), "free some, or set TMPDIR");
  // A folder of its own: the name is what the person knows the file by.
  const fs::path folder = folder_ / std::to_string(++count_);
  fs::create_directory(folder, error);
  if (error) throw Error(folder.string(), "cannot be made: " + error.message());
  return files_.emplace_back(File{folder / name, size}).path;
}

void DroppedFiles::abandon(const fs::path& file) {
  std::error_code unused;
  fs::remove(file, unused);
  std::erase_if(files_, [&](const File& other) { return other.path == file; });
}

}  // namespace palpate
