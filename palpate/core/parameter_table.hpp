// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <type_traits>
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

/// The owner of the member that a pointer names.
template <class Owner, class Member>
Owner owner_of(Member Owner::*);

/// The row of the member at the end of `path`, pointers to members of one another. Its default is
/// what the member begins with.
template <auto first, auto... path>
constexpr auto row_of(std::string_view name, std::string_view symbol, std::string_view unit,
                      double min, double max, std::string_view meaning,
                      std::string_view source = "ours") {
  using Owner = decltype(owner_of(first));
  constexpr auto get = [](const Owner& owner) {
    return static_cast<double>(((owner.*first).*....*path));
  };
  constexpr auto set = [](Owner& owner, double value) {
    auto& member = ((owner.*first).*....*path);
    member = static_cast<std::remove_reference_t<decltype(member)>>(value);
  };
  return ParameterRow<Owner>{name, symbol, unit, get(Owner{}), min, max, meaning, source, get, set};
}

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
