// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// One row of a table of numbers that can be set: it feeds help texts, configuration files and the
/// page's sliders. `Owner` is the struct that holds them.
template <class Owner>
struct ParameterRow {
  std::string_view name;
  std::string_view symbol;  ///< as in the paper, empty where it has none
  std::string_view unit;    ///< "-" where it has none
  double default_value;
  double min;  ///< smallest value allowed
  double max;  ///< largest value allowed
  std::string_view meaning;
  std::string_view source;  ///< where it is published; "ours"
  double (*get)(const Owner&);
  void (*set)(Owner&, double);
};

/// A number as messages show it.
std::string number_text(double value);

/// @param noun  what a row is, such as "parameter"
/// @throws Error if the value is not finite or not in [min, max].
void check_range(std::string_view noun, std::string_view name, std::string_view unit, double min,
                 double max, double value);
/// @throws Error naming the nearest of the known names.
[[noreturn]] void refuse_name(std::string_view noun, std::string_view name,
                              std::span<const std::string_view> known);

/// @throws Error naming the first number that is out of its range.
template <class Owner>
void check_ranges(std::span<const ParameterRow<Owner>> table, const Owner& owner,
                  std::string_view noun) {
  for (const auto& row : table)
    check_range(noun, row.name, row.unit, row.min, row.max, row.get(owner));
}

/// The row of that name. @throws Error if there is none.
template <class Owner>
const ParameterRow<Owner>& row_by_name(std::span<const ParameterRow<Owner>> table,
                                       std::string_view name, std::string_view noun) {
  std::vector<std::string_view> names;
  for (const auto& row : table) {
    if (row.name == name) return row;
    names.push_back(row.name);
  }
  refuse_name(noun, name, names);
}

/// Sets one number by name. @throws Error for an unknown name or a value out of its range.
template <class Owner>
void set_by_name(std::span<const ParameterRow<Owner>> table, Owner& owner, std::string_view name,
                 double value, std::string_view noun) {
  const ParameterRow<Owner>& row = row_by_name(table, name, noun);
  check_range(noun, row.name, row.unit, row.min, row.max, value);
  row.set(owner, value);
}

}  // namespace palpate
