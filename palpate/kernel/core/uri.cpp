// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/uri.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <sstream>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

struct Unit {
  std::string_view name;  // lower case
  std::string_view si;    // as in number_option
  double factor;
};

constexpr std::array units{
    Unit{"um", "m", 1e-6},
    Unit{"mm", "m", 1e-3},
    Unit{"cm", "m", 1e-2},
    Unit{"m", "m", 1.0},
    Unit{"us", "s", 1e-6},
    Unit{"ms", "s", 1e-3},
    Unit{"s", "s", 1.0},
    Unit{"hz", "Hz", 1.0},
    Unit{"khz", "Hz", 1e3},
    Unit{"rad", "rad", 1.0},
    Unit{"deg", "rad", 3.14159265358979323846 / 180.0},
    Unit{"%", "1", 1e-2},
};

bool is_scheme(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '-' || c == '+';
  });
}

}  // namespace

Uri::Uri(std::string_view text) : text_(text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos || !is_scheme(text.substr(0, colon))) {
    throw Error("'" + text_ + "'", "does not start with a scheme",
                "write SCHEME:PATH, such as synthetic:desk");
  }
  scheme_ = text.substr(0, colon);
  std::string_view rest = text.substr(colon + 1);
  const std::size_t mark = rest.rfind('?');
  path_ = rest.substr(0, mark);
  rest = mark == std::string_view::npos ? std::string_view{} : rest.substr(mark + 1);
  while (!rest.empty()) {
    const std::string_view option = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(option.size() + 1, rest.size()));
    const std::size_t equals = option.find('=');
    const std::string_view key = option.substr(0, equals);
    const std::string_view value =
        equals == std::string_view::npos ? std::string_view{} : option.substr(equals + 1);
    if (key.empty()) {
      throw Error(text_, "has an option without a name", "write ?KEY=VALUE&KEY=VALUE");
    }
    if (!options_.emplace(key, value).second) {
      throw Error(text_, "option '" + std::string(key) + "' is given twice", "leave one of them");
    }
  }
}

bool Uri::has(std::string_view key) const { return options_.find(key) != options_.end(); }

std::string Uri::text_option(std::string_view key, std::string_view fallback) const {
  const auto option = options_.find(key);
  return option == options_.end() ? std::string(fallback) : option->second;
}

double Uri::number_option(std::string_view key, double fallback, double min, double max,
                          std::string_view si_unit) const {
  const auto option = options_.find(key);
  if (option == options_.end()) {
    return fallback;
  }
  const std::string& value = option->second;
  const std::string subject = text_ + ": option '" + std::string(key) + "'";
  double number = 0.0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc{} || !std::isfinite(number)) {
    throw Error(subject, "'" + value + "' is not a finite number", "give a number");
  }
  const std::string unit =
      lower_case({end, static_cast<std::size_t>(value.data() + value.size() - end)});
  if (!unit.empty()) {
    const auto* known = std::find_if(units.begin(), units.end(), [&](const Unit& candidate) {
      return candidate.name == unit && (si_unit.empty() || candidate.si == si_unit);
    });
    if (known == units.end()) {
      std::string fitting;
      for (const Unit& candidate : units) {
        if (si_unit.empty() || candidate.si == si_unit) {
          fitting += (fitting.empty() ? "" : ", ") + std::string(candidate.name);
        }
      }
      throw Error(subject, "the unit of '" + value + "' does not fit",
                  fitting.empty() ? "give a plain number" : "valid units: " + fitting);
    }
    number *= known->factor;
  }
  if (number < min || number > max) {
    std::ostringstream range;
    range << "give a value from " << min << " to " << max;
    if (!si_unit.empty() && si_unit != "1" && si_unit != "-") {
      range << ' ' << si_unit;
    }
    throw Error(subject, "'" + value + "' is out of range", range.str());
  }
  return number;
}

Uri Uri::without(std::string_view key) const {
  Uri left = *this;
  left.taken_.emplace_back(key);
  if (left.options_.erase(std::string(key)) == 0) return left;
  const std::size_t mark = text_.rfind('?');
  std::string_view rest = std::string_view(text_).substr(mark + 1);
  std::string kept;
  while (!rest.empty()) {
    const std::string_view option = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(option.size() + 1, rest.size()));
    if (option.substr(0, option.find('=')) == key) continue;
    kept += (kept.empty() ? "" : "&") + std::string(option);
  }
  left.text_.resize(mark);
  if (!kept.empty() || path_.find('?') != std::string::npos) left.text_ += "?" + kept;
  return left;
}

void Uri::allow_only(std::span<const std::string_view> own) const {
  std::vector<std::string_view> known(own.begin(), own.end());
  known.insert(known.end(), taken_.begin(), taken_.end());
  for (const auto& [key, value] : options_) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    throw Error(text_, "unknown option '" + key + "'",
                known.empty() ? "it takes none" : did_you_mean(key, known));
  }
}

}  // namespace palpate
