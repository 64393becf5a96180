// SPDX-License-Identifier: Apache-2.0
#include "lab/table.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>

#include "palpate/kernel/core/error.hpp"

namespace palpate::lab {
namespace {

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  for (;;) {
    const std::size_t at = text.find(separator);
    parts.emplace_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

}  // namespace

Table::Table(std::string_view subject, std::string_view csv) : subject_(subject) {
  for (const std::string& line : split(csv, '\n')) {
    if (line.empty()) continue;
    std::vector<std::string> fields = split(line, ',');
    if (columns_.empty()) {
      columns_ = std::move(fields);
      continue;
    }
    if (fields.size() != columns_.size())
      throw Error(subject_,
                  "row " + std::to_string(rows_.size() + 1) + " has " +
                      std::to_string(fields.size()) + " fields, not " +
                      std::to_string(columns_.size()),
                  "run the experiment again");
    rows_.push_back(std::move(fields));
  }
}

std::size_t Table::index(std::string_view column) const {
  const auto found = std::find(columns_.begin(), columns_.end(), column);
  if (found == columns_.end())
    throw Error(subject_, "there is no column '" + std::string(column) + "'",
                "run the experiment again");
  return static_cast<std::size_t>(found - columns_.begin());
}

bool Table::has(std::string_view column) const {
  return std::find(columns_.begin(), columns_.end(), column) != columns_.end();
}

const std::string& Table::text(std::size_t row, std::string_view column) const {
  return rows_.at(row)[index(column)];
}

double Table::number(std::size_t row, std::string_view column) const {
  const std::string& field = text(row, column);
  double value = 0.0;
  const auto [rest, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc{} || rest != field.data() + field.size())
    throw Error(subject_, "'" + field + "' in column '" + std::string(column) + "' is not a number",
                "run the experiment again");
  return value;
}

std::vector<std::string> methods_in(const Table& table) {
  std::vector<std::string> methods;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string& method = table.text(row, "method");
    if (std::find(methods.begin(), methods.end(), method) == methods.end())
      methods.push_back(method);
  }
  return methods;
}

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::string csv_field(double number) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), number).ptr};
}

}  // namespace palpate::lab
