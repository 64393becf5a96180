// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cctype>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// Adds an item to a list for a message: "a, b".
inline void add_to_list(std::string& list, std::string_view item) {
  if (!list.empty()) list += ", ";
  list += item;
}

/// In lower case.
inline std::string lower_case(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

/// What stands behind `key` in "a=1;b=2;"; none if the key is not there.
inline std::optional<std::string_view> value_of(std::string_view text, std::string_view key) {
  while (!text.empty()) {
    const std::string_view pair = text.substr(0, text.find(';'));
    text.remove_prefix(std::min(text.size(), pair.size() + 1));
    if (pair.substr(0, pair.find('=')) == key && pair.size() > key.size())
      return pair.substr(key.size() + 1);
  }
  return std::nullopt;
}

/// The numbers of a version with points between them: "3.17.5".
inline std::string version_text(std::initializer_list<int> numbers) {
  std::string text;
  for (const int number : numbers) text += (text.empty() ? "" : ".") + std::to_string(number);
  return text;
}

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
