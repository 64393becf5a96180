// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/parameter_table.hpp"

#include <array>
#include <charconv>
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/core/nearest_name.hpp"

namespace palpate {

std::string number_text(double value) {
  std::array<char, 32> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 6);
  return {text.data(), end.ptr};
}

void check_range(std::string_view noun, std::string_view name, std::string_view unit, double min,
                 double max, double value) {
  if (std::isfinite(value) && value >= min && value <= max) return;
  const std::string shown = unit == "-" ? "" : " " + std::string(unit);
  throw Error(std::string(noun) + " '" + std::string(name) + "'",
              number_text(value) + shown + " is out of range",
              "give a value from " + number_text(min) + " to " + number_text(max) + shown);
}

void refuse_name(std::string_view noun, std::string_view name,
                 std::span<const std::string_view> known) {
  const std::string_view near = nearest_name(name, known);
  throw Error(std::string(noun) + " '" + std::string(name) + "'",
              "there is no such " + std::string(noun),
              near.empty() ? "see 'palpate parameters' for their names"
                           : "did you mean '" + std::string(near) + "'?");
}

}  // namespace palpate
