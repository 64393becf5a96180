// SPDX-License-Identifier: Apache-2.0
#pragma once

// Included before all else in a build for browsers.

#include <Eigen/src/Core/util/Macros.h>
// Eigen takes emscripten's clang for a GCC of before 6.3, which needs x86's assembler.
#undef EIGEN_COMP_GNUC
#define EIGEN_COMP_GNUC 0

// What emscripten's standard libraries of 2022 (Debian 12) and 2024 (Debian 13) lack of C++20.
#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <version>

namespace std {

#if !defined(__cpp_lib_bit_cast)
template <class To, class From>
constexpr To bit_cast(const From& from) noexcept {
  return __builtin_bit_cast(To, from);
}
#endif

#if _LIBCPP_VERSION < 200000
// Decimal numbers alone, as no file and no option holds others.
inline from_chars_result from_chars(const char* first, const char* last, double& value) {
  const char* digits = first != last && *first == '-' ? first + 1 : first;
  const bool is_number = digits != last && (*digits == '.' || *digits == 'i' || *digits == 'n' ||
                                            (*digits >= '0' && *digits <= '9'));
  if (!is_number) return {first, errc::invalid_argument};
  const bool is_hexadecimal = last - digits > 1 && digits[0] == '0' && (digits[1] | 0x20) == 'x';
  const string text(first, is_hexadecimal ? digits + 1 : last);
  char* end = nullptr;
  const double number = strtod(text.c_str(), &end);
  if (end == text.c_str()) return {first, errc::invalid_argument};
  const bool is_infinite = number - number != 0.0 && *digits != 'i' && *digits != 'n';
  const char* stop = first + (end - text.c_str());
  if (is_infinite) return {stop, errc::result_out_of_range};
  value = number;
  return {stop, errc()};
}
inline from_chars_result from_chars(const char* first, const char* last, float& value) {
  double number = value;
  const from_chars_result result = from_chars(first, last, number);
  if (result.ec == errc()) value = static_cast<float>(number);
  return result;
}
#endif

#if _LIBCPP_VERSION < 14000
// The fewest digits, of up to 17, that are read as the same number.
inline to_chars_result to_chars(char* first, char* last, double value) {
  char text[32];
  int length = 0;
  for (int digits = 1; digits <= 17; ++digits) {
    length = snprintf(text, sizeof text, "%.*g", digits, value);
    if (strtod(text, nullptr) == value) break;
  }
  if (last - first < length) return {last, errc::value_too_large};
  return {copy(text, text + length, first), errc()};
}
inline to_chars_result to_chars(char* first, char* last, double value, chars_format format,
                                int digits) {
  const char* form = format == chars_format::fixed ? "%.*f" : "%.*g";
  const int length = snprintf(nullptr, 0, form, digits, value);
  if (last - first < length) return {last, errc::value_too_large};
  string text(static_cast<size_t>(length) + 1, '\0');
  snprintf(text.data(), text.size(), form, digits, value);
  return {copy(text.data(), text.data() + length, first), errc()};
}
#endif

}  // namespace std
