// SPDX-License-Identifier: Apache-2.0

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/verbs.hpp"
#include "palpate/kernel/cloud/material_map.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/servo/safety.hpp"

namespace palpate::app {
namespace {

int print_parameters() {
  fmt::print("{:<18} {:<4} {:<11} {:>12} {:>9} {:>9}  {}\n", "name", "", "unit", "default", "min",
             "max", "meaning (source)");
  for (const ParameterInfo& row : parameter_table()) {
    // The width of a Greek letter is one column, but two bytes.
    fmt::print("{:<18} {:<4} {:<11} {:>12.6g} {:>9g} {:>9g}  {} ({})\n", row.name, row.symbol,
               row.unit, row.default_value, row.min, row.max, row.meaning, row.source);
  }
  fmt::print("\nlimits of the safety chain (--limit):\n");
  for (const SafetyParameterInfo& row : safety_parameter_table())
    fmt::print("{:<18} {:<4} {:<11} {:>12.6g} {:>9g} {:>9g}  {}\n", row.name, "", row.unit,
               row.default_value, row.min, row.max, row.meaning);
  fmt::print("\nmaterials (--material), with the values that differ from the default surface:\n");
  for (const NamedMaterial& named : standard_materials().materials) {
    std::string numbers;
    for (const MaterialInfo& row : material_table()) {
      if (row.get(named.material) == row.default_value) continue;
      numbers +=
          fmt::format("{}{} {:g}{}", numbers.empty() ? "" : ", ", row.name, row.get(named.material),
                      row.unit == "-" ? "" : " " + std::string(row.unit));
    }
    fmt::print("{:<18} {}\n", named.name, numbers);
  }
  return 0;
}

}  // namespace

Verb add_parameters(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "parameters",
      "list the values for --set, --limit and --material: default, range and meaning");
  return {command, print_parameters};
}

}  // namespace palpate::app
