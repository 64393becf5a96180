// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/csv.hpp"

#include <algorithm>
#include <charconv>
#include <system_error>
#include <utility>

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

}  // namespace

CsvColumns::CsvColumns(std::istream& in, std::string subject,
                       std::span<const std::string_view> columns)
    : in_(in), subject_(std::move(subject)), columns_(columns) {
  if (!read_line())
    throw Error(subject_, "it is empty", "begin the file with the line '" + header() + "'");
  for (const std::string_view column : columns_) {
    const auto found = std::find(fields_.begin(), fields_.end(), column);
    if (found == fields_.end()) {
      throw Error(where(), "the header has no column '" + std::string(column) + "'",
                  "begin the file with the line '" + header() + "'");
    }
    places_.push_back(static_cast<std::size_t>(found - fields_.begin()));
  }
}

bool CsvColumns::next(std::span<double> values) {
  if (!read_line()) return false;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const std::string_view field =
        places_[i] < fields_.size() ? fields_[places_[i]] : std::string_view{};
    const char* const end = field.data() + field.size();
    const auto [stop, error] = std::from_chars(field.data(), end, values[i]);
    if (field.empty() || error != std::errc{} || stop != end) {
      throw Error(where(),
                  std::string(columns_[i]) + (field.empty() ? " is missing" : " is not a number"),
                  "give a number for each of " + header());
    }
  }
  return true;
}

std::string CsvColumns::where() const { return subject_ + ": line " + std::to_string(line_); }

std::string CsvColumns::header() const {
  std::string header;
  for (const std::string_view column : columns_)
    header += (header.empty() ? "" : ",") + std::string(column);
  return header;
}

// The fields of the next line that is not blank.
bool CsvColumns::read_line() {
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  while (std::getline(in_, text_)) {
    std::string_view line = text_;
    if (++line_ == 1 && line.starts_with(byte_order_mark))
      line.remove_prefix(byte_order_mark.size());
    line = trimmed(line);
    if (line.empty()) continue;
    fields_.clear();
    for (;;) {
      const std::size_t comma = line.find(',');
      fields_.push_back(trimmed(line.substr(0, comma)));
      if (comma == std::string_view::npos) return true;
      line.remove_prefix(comma + 1);
    }
  }
  if (in_.bad()) throw Error(subject_, "it cannot be read to its end", "check the disk");
  return false;
}

}  // namespace palpate
