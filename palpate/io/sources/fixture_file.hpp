// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "palpate/kernel/fixtures/fixture_set.hpp"

namespace palpate {

/// The fixtures of a TOML file: tables [[fixture]] with `name`, `kind`, `shape`, the shape's
/// geometry, any of fixture_table()'s numbers, and `one_way`, `consent`, `on_surface`.
/// docs/fixtures.md has all keys and an example.
/// @throws Error naming file and line
FixtureSet read_fixtures(const std::filesystem::path& file);
/// The same of its text.
/// @param name    of the file, for messages
/// @param folder  in which meshes' files are looked for
FixtureSet parse_fixtures(std::string_view text, const std::string& name,
                          const std::filesystem::path& folder);

/// A set as JSON, meshes and all, and back to the bit: for recordings and pages.
std::string fixtures_json(const FixtureSet& set);
/// @throws Error naming `what` if it is damaged
std::shared_ptr<const FixtureSet> fixtures_from_json(std::string_view text,
                                                     const std::string& what);

}  // namespace palpate
