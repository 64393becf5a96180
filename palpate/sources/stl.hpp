// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>

#include "palpate/sources/point_file.hpp"

namespace palpate {

/// Reads an STL file, binary or ascii, into `points` and `triangles`. Corners at the same place are
/// one point. Normals and attributes are passed over.
///
/// Allocates in proportion to the size of the file, whatever its header declares.
/// @throws Error naming the file and what was wrong
PointFile read_stl(const std::filesystem::path& path);
/// The same for bytes in memory; `name` is what an error calls them.
PointFile parse_stl(std::span<const std::byte> bytes, std::string_view name);

}  // namespace palpate
