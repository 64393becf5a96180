// SPDX-License-Identifier: Apache-2.0
#include "lab/table.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>

#include "palpate/kernel/core/error.hpp"

namespace palpate::lab {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

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

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines = split(text, '\n');
  if (lines.back().empty()) lines.pop_back();  // behind the last newline
  return lines;
}

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

bool Table::is(std::size_t row, const Where& where) const {
  return std::all_of(where.begin(), where.end(),
                     [&](const auto& wanted) { return text(row, wanted.first) == wanted.second; });
}

Table Table::where(const Where& where) const {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t row = 0; row < rows_.size(); ++row)
    if (is(row, where)) rows.push_back(rows_[row]);
  return {*this, std::move(rows)};
}

std::vector<Table> Table::by(const std::vector<std::string_view>& keys) const {
  std::vector<Table> groups;
  std::map<std::vector<std::string>, std::size_t> known;
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    std::vector<std::string> texts;
    for (const std::string_view key : keys) texts.push_back(text(row, key));
    const auto [group, is_new] = known.emplace(std::move(texts), groups.size());
    if (is_new) groups.push_back({*this, {}});
    groups[group->second].rows_.push_back(rows_[row]);
  }
  return groups;
}

std::vector<std::string> texts_in(const Table& table, std::string_view column) {
  std::vector<std::string> texts;
  for (const Table& group : table.by({column})) texts.push_back(group.text(0, column));
  return texts;
}

double first(std::span<const double> values) { return values.empty() ? none : values.front(); }

double sum(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

double largest(std::span<const double> values) {
  return values.empty() ? 0.0 : *std::max_element(values.begin(), values.end());
}

double median(std::span<const double> values) {
  if (values.empty()) return none;
  std::vector<double> sorted(values.begin(), values.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

void write_file(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out << text << std::flush;
  if (!out)
    throw Error(file.string(), std::string("cannot be written: ") + std::strerror(errno),
                "use a folder with write permission and free disk space");
}

}  // namespace palpate::lab
