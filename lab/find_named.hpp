// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/core/text.hpp"

namespace palpate::lab {

/// The entry of a list that has that `name`.
/// @param noun   what an entry is, such as "experiment"
/// @param what   what is wrong if there is none, such as "there is no such experiment"
/// @param known  begins the list of all: "the experiments are "
/// @throws Error for an unknown name, naming the nearest one and listing all.
template <class Entries>
const auto& find_named(const Entries& entries, std::string_view name, std::string_view noun,
                       const std::string& what, const std::string& known,
                       const std::string& also = {}) {
  std::vector<std::string_view> names;
  std::string list;
  for (const auto& entry : entries) {
    if (entry.name == name) return entry;
    names.push_back(entry.name);
    list += (list.empty() ? "" : ", ") + std::string(entry.name);
  }
  const std::string_view near = nearest_name(name, names);
  throw Error(
      std::string(noun) + " '" + std::string(name) + "'", what,
      (near.empty() ? "" : "did you mean '" + std::string(near) + "'? ") + known + list + also);
}

}  // namespace palpate::lab
