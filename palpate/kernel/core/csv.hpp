// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <istream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// Named columns of numbers in a CSV text with a header. Blank lines, a byte order mark, spaces
/// around fields, and columns that nobody asked for are passed over.
class CsvColumns {
 public:
  /// Reads the header.
  /// @param columns  that are wanted; they must live as long as this
  /// @param subject  what an error names, such as the file
  /// @throws Error naming the first column that is missing
  CsvColumns(std::istream& in, std::string subject, std::span<const std::string_view> columns);

  /// The next line's numbers, in the order of the columns that were asked for; they may be
  /// infinite or NaN. False at the end.
  /// @throws Error naming the line and the column of what is missing or no number, or if the text
  ///         cannot be read to its end
  bool next(std::span<double> values);

  /// `subject: line N` of the line read last, for errors about its values.
  [[nodiscard]] std::string where() const;
  /// The columns as a header has them, `t,x,y,z`.
  [[nodiscard]] std::string header() const;

 private:
  bool read_line();

  std::istream& in_;
  std::string subject_;
  std::span<const std::string_view> columns_;
  std::vector<std::size_t> places_;  // of each column in a line
  std::string text_;
  std::vector<std::string_view> fields_;  // of `text_`
  std::size_t line_ = 0;                  // from 1
};

}  // namespace palpate
