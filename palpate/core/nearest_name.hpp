// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// The candidate with the smallest edit distance to `word`, or empty if none is near enough to be
/// what was meant.
std::string_view nearest_name(std::string_view word, std::span<const std::string_view> candidates);

/// The remedy for a name that is not known: "did you mean 'desk'? known here: desk, wall".
/// @param suffix  what follows a name where people write it
std::string did_you_mean(std::string_view name, std::span<const std::string_view> known,
                         std::string_view suffix = {});

/// The names of `entries`, which must outlive them.
template <class Entries>
std::vector<std::string_view> names_of(const Entries& entries) {
  std::vector<std::string_view> names;
  for (const auto& entry : entries) names.push_back(entry.name);
  return names;
}

}  // namespace palpate
