// SPDX-License-Identifier: Apache-2.0
#include "palpate/sources/natural_order.hpp"

#include <algorithm>

namespace palpate {
namespace {

constexpr std::string_view digits = "0123456789";

// Cuts the digits that `rest` begins with from it; returns them without leading zeros.
std::string_view take_number(std::string_view& rest) noexcept {
  std::string_view number = rest.substr(0, rest.find_first_not_of(digits));
  rest.remove_prefix(number.size());
  number.remove_prefix(std::min(number.find_first_not_of('0'), number.size()));
  return number;
}

}  // namespace

bool natural_less(std::string_view a, std::string_view b) noexcept {
  std::string_view x = a, y = b;
  while (!x.empty() && !y.empty()) {
    const bool x_number = digits.find(x.front()) != std::string_view::npos;
    const bool y_number = digits.find(y.front()) != std::string_view::npos;
    if (x_number && y_number) {
      const std::string_view m = take_number(x), n = take_number(y);
      if (m != n) {
        return m.size() != n.size() ? m.size() < n.size() : m < n;
      }
    } else if (x.front() != y.front()) {
      return x.substr(0, 1) < y.substr(0, 1);
    } else {
      x.remove_prefix(1);
      y.remove_prefix(1);
    }
  }
  return x.empty() && y.empty() ? a < b : x.empty();
}

}  // namespace palpate
