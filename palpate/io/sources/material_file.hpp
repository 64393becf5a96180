// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/material_map.hpp"

namespace palpate {

/// Materials, and how a camera's frames are told which of them is where.
struct Materials {
  std::shared_ptr<const MaterialTable> table;
  bool everywhere = false;  ///< the first is that of all that is seen
};

/// The materials of a TOML file: tables [[material]] with `name`, any of material_table()'s
/// numbers, `like` (a standard material, or one above it in the file, to begin from), `colour`
/// ("#rrggbb") and `tolerance`. The first has label 1. docs/materials.md has an example.
/// @throws Error naming file and line
MaterialTable read_materials(const std::filesystem::path& file);
/// The same of its text. @param name  of the file, for messages
MaterialTable parse_materials(std::string_view text, const std::string& name);

/// A standard material by its name, which is then that of all that is seen; or a file.
/// @throws Error if it is neither, or read_materials does
Materials materials_of(const std::string& name_or_file);

/// A table as JSON, and back: for recordings and other languages.
std::string materials_json(const MaterialTable& table);
/// @throws Error naming `what` if it is damaged
MaterialTable materials_from_json(std::string_view text, const std::string& what);

/// Says what each frame of a camera is made of: by the frame's own labels, or else by its colours.
/// Frames of points stay as they are.
/// @throws Error at the first frame, if materials are told by colour and it has none
std::unique_ptr<Source> with_materials(std::unique_ptr<Source> source, Materials materials);

}  // namespace palpate
