// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate::lab {

/// The entry of a list that has that `name`.
/// @param noun  what an entry is, such as "experiment"
/// @param what  what is wrong if there is none, such as "there is no such experiment"
/// @param also  another name that may stand there
/// @throws Error for an unknown name, naming the nearest one and listing all.
template <class Entries>
const auto& find_named(const Entries& entries, std::string_view name, const std::string& noun,
                       const std::string& what, std::string_view also = {}) {
  for (const auto& entry : entries)
    if (entry.name == name) return entry;
  std::vector<std::string_view> known = names_of(entries);
  if (!also.empty()) known.push_back(also);
  throw Error(noun + " '" + std::string(name) + "'", what, did_you_mean(name, known));
}

}  // namespace palpate::lab
