// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lab/experiment.hpp"
#include "lab/plot.hpp"
#include "lab/table.hpp"

namespace palpate::lab {

/// Scores of a bench that measures methods beside aims, which are upper bounds: a row a measure, a
/// column a method. What misses its aim is marked, and the last row counts the aims met.
class AimTable {
 public:
  /// @param labels  names of the columns before that of the aim
  AimTable(std::vector<std::string> labels, std::vector<std::string> methods);

  [[nodiscard]] const std::vector<std::string>& methods() const { return methods_; }
  /// A row. @param labels  one a column before the aim's
  /// @param values  one a method; none where there is nothing to measure, which misses any aim
  void add(std::vector<std::string> labels, std::optional<double> aim,
           const std::vector<std::optional<double>>& values);
  [[nodiscard]] Scores scores(std::string note) const;

 private:
  std::vector<std::string> methods_;
  Scores scores_;
  std::vector<int> met_;  // aims, by each method
  int aims_ = 0;
};

/// A measure as the table names it. @param unit  empty where it has none
std::string measure_text(std::string_view name, std::string_view unit);

/// Each measure of a table's columns "scene", "measure", "aim" and "value" divided by its aim, if
/// it has one and `keep(row)` is true; what is exact or lost has no mark.
Figure figure_of_aims(const Table& table, const std::function<bool(std::size_t)>& keep);

}  // namespace palpate::lab
