// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/kernel/core/pose.hpp"

namespace palpate::lab {

/// Columns and the text that each has in the rows that are meant.
using Where = std::vector<std::pair<std::string_view, std::string_view>>;

std::vector<std::string> lines_of(const std::string& text);

/// A CSV as read back, to make claims from.
class Table {
 public:
  /// @throws Error naming `subject` if a row has not as many fields as the header.
  Table(std::string_view subject, std::string_view csv);

  [[nodiscard]] std::size_t rows() const { return rows_.size(); }
  /// @throws Error if there is no such column.
  [[nodiscard]] const std::string& text(std::size_t row, std::string_view column) const;
  [[nodiscard]] double number(std::size_t row, std::string_view column) const;

  /// The numbers of a column in the rows that `keep(row)` is true for.
  template <class Keep>
  [[nodiscard]] std::vector<double> numbers(std::string_view column, const Keep& keep) const {
    std::vector<double> values;
    for (std::size_t row = 0; row < rows(); ++row) {
      if (keep(row)) values.push_back(number(row, column));
    }
    return values;
  }
  [[nodiscard]] std::vector<double> numbers(std::string_view column,
                                            const Where& where = {}) const {
    return numbers(column, [&](std::size_t row) { return is(row, where); });
  }
  /// Are all of these in the row?
  [[nodiscard]] bool is(std::size_t row, const Where& where) const;
  /// The rows that have all of these.
  [[nodiscard]] Table where(const Where& where) const;
  /// The rows in groups that have the same text in all `keys`, in the order of their first rows.
  [[nodiscard]] std::vector<Table> by(const std::vector<std::string_view>& keys) const;

 private:
  Table(const Table& of, std::vector<std::vector<std::string>> rows)
      : subject_(of.subject_), columns_(of.columns_), rows_(std::move(rows)) {}
  [[nodiscard]] std::size_t index(std::string_view column) const;

  std::string subject_;
  std::vector<std::string> columns_;
  std::vector<std::vector<std::string>> rows_;
};

/// The texts of a column, each once, in the order of their first rows.
std::vector<std::string> texts_in(const Table& table, std::string_view column);

// What stands for the numbers of a column.
/// NaN of none.
double first(std::span<const double> values);
double sum(std::span<const double> values);
/// 0 of none.
double largest(std::span<const double> values);
/// The upper one of the two in the middle of an even number; NaN of none.
double median(std::span<const double> values);

/// A field of a CSV: numbers in the shortest form that reads back to the same value.
inline std::string csv_field(double number) { return shortest(number); }
inline std::string csv_field(std::string_view text) { return std::string(text); }
template <std::integral Whole>
std::string csv_field(Whole number) {
  return std::to_string(static_cast<long long>(number));
}

/// One row of a CSV with its newline.
template <class... Fields>
std::string csv_row(const Fields&... fields) {
  std::string line;
  ((line += csv_field(fields) + ','), ...);
  line.back() = '\n';
  return line;
}

/// Writes a file as a whole. @throws Error if it cannot be written.
void write_file(const std::filesystem::path& file, const std::string& text);

}  // namespace palpate::lab
