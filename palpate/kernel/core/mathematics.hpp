// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>

namespace palpate::math {

// The functions of the mathematical library that the path from frame to force uses, of our own:
// additions, multiplications, divisions and square roots alone, which every processor and compiler
// rounds alike, so that the same session gives the same forces everywhere. Within 2 units of the
// last place of a double where not said otherwise. Unlike std::, they know no signed zeros and
// report no errors. None throws, allocates or blocks. [servo]

namespace detail {
// The value of c[0] + c[1] x + ... + c[n-1] x^(n-1), by Horner's rule.
template <std::size_t n>
constexpr double polynomial(const double (&c)[n], double x) noexcept {
  double sum = c[n - 1];
  for (std::size_t i = n - 1; i-- > 0;) sum = sum * x + c[i];
  return sum;
}

// 2^n for whole n from -1022 to 1023.
inline double power_of_two(std::int64_t n) noexcept {
  return std::bit_cast<double>(static_cast<std::uint64_t>(n + 1023) << 52U);
}

// ln 2 in two parts, of which the first has 20 zero bits at its end: whole multiples are exact.
inline constexpr double ln2_high = 0x1.62e42fee00000p-1;
inline constexpr double ln2_low = 0x1.a39ef35793c76p-33;

// e^x - 1 for |x| <= ln 2 / 2: 14 terms of its series.
inline double exp_less_1(double x) noexcept {
  constexpr double c[] = {1.0,
                          1.0 / 2,
                          1.0 / 6,
                          1.0 / 24,
                          1.0 / 120,
                          1.0 / 720,
                          1.0 / 5040,
                          1.0 / 40320,
                          1.0 / 362880,
                          1.0 / 3628800,
                          1.0 / 39916800,
                          1.0 / 479001600,
                          1.0 / 6227020800,
                          1.0 / 87178291200};
  return x * polynomial(c, x);
}
}  // namespace detail

/// e^x; 0 below -745, infinite above 709.78.
inline double exp(double x) noexcept {
  if (!(x > -745.0)) return x != x ? x : 0.0;
  if (x > 709.78) return std::numeric_limits<double>::infinity();
  const double n = std::floor(x * std::numbers::log2e + 0.5);
  const double rest = (x - n * detail::ln2_high) - n * detail::ln2_low;
  const auto whole = static_cast<std::int64_t>(n);
  const std::int64_t half = whole / 2;  // in two steps, as 2^n alone may not be a double
  return (1.0 + detail::exp_less_1(rest)) * detail::power_of_two(half) *
         detail::power_of_two(whole - half);
}

/// e^x - 1, also of small x. Within 4 units of the last place.
inline double expm1(double x) noexcept {
  return std::abs(x) < 0.34 ? detail::exp_less_1(x) : exp(x) - 1.0;
}

/// The natural logarithm; NaN below 0, minus infinity at 0.
inline double log(double x) noexcept {
  if (!(x > 0.0)) {
    return x == 0.0 ? -std::numeric_limits<double>::infinity()
                    : std::numeric_limits<double>::quiet_NaN();
  }
  if (x > std::numeric_limits<double>::max()) return x;
  double exponent = 0.0;
  if (x < std::numeric_limits<double>::min()) {  // subnormal
    x *= 0x1p54;
    exponent = -54.0;
  }
  const auto bits = std::bit_cast<std::uint64_t>(x);
  // x = 2^exponent m with m from sqrt(1/2) to sqrt(2).
  auto m = std::bit_cast<double>((bits & 0xfffffffffffffU) | 0x3ff0000000000000U);
  exponent += static_cast<double>(static_cast<std::int64_t>(bits >> 52U) - 1023);
  if (m > std::numbers::sqrt2) {
    m *= 0.5;
    exponent += 1.0;
  }
  // ln m = 2 artanh f = 2 (f + f^3 / 3 + f^5 / 5 + ...)
  constexpr double c[] = {1.0 / 3,  1.0 / 5,  1.0 / 7,  1.0 / 9,  1.0 / 11,
                          1.0 / 13, 1.0 / 15, 1.0 / 17, 1.0 / 19, 1.0 / 21};
  const double f = (m - 1.0) / (m + 1.0);
  const double ff = f * f;
  const double series = 2.0 * f * ff * detail::polynomial(c, ff);
  return exponent * detail::ln2_high + (2.0 * f + (series + exponent * detail::ln2_low));
}

/// The length of (x, y), which must not overflow when squared.
inline double hypot(double x, double y) noexcept { return std::sqrt(x * x + y * y); }

namespace detail {
// sin and cos for |x| <= pi / 4.
inline double sin_near_0(double x) noexcept {
  constexpr double c[] = {
      -1.0 / 6,        1.0 / 120,          -1.0 / 5040,         1.0 / 362880,
      -1.0 / 39916800, 1.0 / 6227020800.0, -1.0 / 1307674368e3, 1.0 / 355687428096e3};
  const double xx = x * x;
  return x + x * xx * polynomial(c, xx);
}
inline double cos_near_0(double x) noexcept {
  constexpr double c[] = {1.0 / 24,        -1.0 / 720,           1.0 / 40320,        -1.0 / 3628800,
                          1.0 / 479001600, -1.0 / 87178291200.0, 1.0 / 20922789888e3};
  const double xx = x * x;
  const double half = 0.5 * xx;
  const double most = 1.0 - half;
  return most + ((1.0 - most) - half + xx * xx * polynomial(c, xx));
}

// sin(x + quarter_turns pi / 2). Errors of up to 1e-16 in the angle, relative to its size.
inline double turned_sin(double x, std::int64_t quarter_turns) noexcept {
  // pi / 2 in three parts, of which the first two have 20 zero bits at their ends.
  constexpr double high = 0x1.921fb54400000p+0;
  constexpr double middle = 0x1.0b4611a600000p-34;
  constexpr double low = 0x1.3198a2e037073p-69;
  const double n = std::floor(x * (2.0 / std::numbers::pi) + 0.5);
  const double rest = ((x - n * high) - n * middle) - n * low;
  const std::int64_t quarter = (static_cast<std::int64_t>(n) + quarter_turns) & 3;
  const double value = (quarter & 1) != 0 ? cos_near_0(rest) : sin_near_0(rest);
  return (quarter & 2) != 0 ? -value : value;
}
}  // namespace detail

/// Of an angle [rad] of at most 1e6.
inline double sin(double x) noexcept { return detail::turned_sin(x, 0); }
inline double cos(double x) noexcept { return detail::turned_sin(x, 1); }

/// [rad] The angle whose cosine is `c` from -1 to 1, from 0 to pi. Within 1e-15.
inline double acos(double c) noexcept {
  // Half of it has the tangent t; three times it is halved, until the series ends soon.
  const double t = std::sqrt((1.0 - c) / (1.0 + c));
  const bool is_steep = t > 1.0;  // beyond a right angle: from the other end, infinite included
  double x = is_steep ? 1.0 / t : t;
  for (int i = 0; i < 2; ++i) x = x / (1.0 + std::sqrt(1.0 + x * x));
  constexpr double k[] = {1.0,      -1.0 / 3,  1.0 / 5,  -1.0 / 7,  1.0 / 9,  -1.0 / 11,
                          1.0 / 13, -1.0 / 15, 1.0 / 17, -1.0 / 19, 1.0 / 21, -1.0 / 23};
  const double angle = 8.0 * x * detail::polynomial(k, x * x);
  return is_steep ? std::numbers::pi - angle : angle;
}

/// x^p of x >= 0. Within 16 units of the last place for p of 2.4 and x from 0.01 to 1.
inline double pow(double x, double p) noexcept { return x == 0.0 ? 0.0 : exp(p * log(x)); }

}  // namespace palpate::math
