// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// All bytes of a file.
/// @param max_bytes  files larger than this are refused before anything is allocated
/// @throws Error if it is no regular file, cannot be read to its end, or is too large.
std::vector<std::byte> read_file(const std::filesystem::path& path, std::uintmax_t max_bytes);

/// The same as a text.
std::string read_text(const std::filesystem::path& path, std::uintmax_t max_bytes);

/// The files in a folder, not below it, whose extension is `extension` (".pcd"; upper and lower
/// case are the same), in natural order of their names: frame_2 before frame_10.
/// @throws Error if the folder cannot be listed.
std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder,
                                            std::string_view extension);

}  // namespace palpate
