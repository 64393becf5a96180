// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {

/// What can be chosen by name: methods, kinds of source, kinds of device.
///
/// A value without global state: copy the library's, add entries of your own, and hand it to a
/// Session. `Entry` has the strings `name` and `summary`.
template <class Entry>
class Registry {
 public:
  /// @param noun     what an entry is, for messages: "method", "type of source"
  /// @param suffix   what follows a name where people write it: ":" for the scheme of a URI
  Registry(std::string noun, std::string suffix, std::vector<Entry> entries)
      : noun_(std::move(noun)), suffix_(std::move(suffix)) {
    for (Entry& entry : entries) add(std::move(entry));
  }

  /// Adds an entry behind the others. @throws Error if its name is empty or taken.
  void add(Entry entry) {
    if (entry.name.empty()) throw Error(noun_, "it has no name", "give one");
    if (try_find(entry.name) != nullptr) {
      throw Error(noun_ + " '" + std::string(entry.name) + suffix_ + "'",
                  "there already is one of that name", "choose another name");
    }
    entries_.push_back(std::move(entry));
  }

  /// Null if there is none of that name.
  [[nodiscard]] const Entry* try_find(std::string_view name) const {
    for (const Entry& entry : entries_) {
      if (entry.name == name) return &entry;
    }
    return nullptr;
  }

  /// @param subject  what the message begins with, such as the whole URI; empty: noun and name
  /// @throws Error for an unknown name, naming the nearest one and listing all.
  [[nodiscard]] const Entry& find(std::string_view name, const std::string& subject = {}) const {
    if (const Entry* entry = try_find(name)) return *entry;
    const std::string quoted = "'" + std::string(name) + suffix_ + "'";
    const std::string what =
        subject.empty() ? "there is no such " + noun_ : "unknown " + noun_ + " " + quoted;
    throw Error(subject.empty() ? noun_ + " " + quoted : subject, what,
                did_you_mean(or_of_summary(name), names_of(entries_), suffix_));
  }

  /// `text` with its scheme: a name of an entry may stand without the suffix.
  /// @throws Error if it has no scheme and names no entry, as find() does.
  [[nodiscard]] std::string with_scheme(const std::string& text) const {
    if (text.find(':') != std::string::npos) return text;
    return std::string(find(text, "'" + text + "'").name) + suffix_;
  }

  /// In the order in which they are shown.
  [[nodiscard]] const std::vector<Entry>& entries() const& { return entries_; }
  const std::vector<Entry>& entries() const&& = delete;  // they would be gone with the registry

 private:
  // Who writes "omega" means "force-dimension": the entry that has the word in its summary, where
  // no name is like it.
  [[nodiscard]] std::string_view or_of_summary(std::string_view word) const {
    constexpr std::size_t shortest = 4;
    if (word.size() < shortest || !nearest_name(word, names_of(entries_)).empty()) return word;
    for (const Entry& entry : entries_) {
      if (lower_case(entry.summary).find(lower_case(word)) != std::string::npos) return entry.name;
    }
    return word;
  }

  std::string noun_, suffix_;
  std::vector<Entry> entries_;
};

}  // namespace palpate
