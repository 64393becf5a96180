// SPDX-License-Identifier: Apache-2.0
#include "lab/statistics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "lab/table.hpp"

namespace palpate::lab {

double mean(std::span<const double> values) {
  return values.empty() ? 0.0 : sum(values) / static_cast<double>(values.size());
}

double rms(const std::vector<double>& values) {
  double squares = 0.0;
  for (const double v : values) squares += v * v;
  return values.empty() ? 0.0 : std::sqrt(squares / static_cast<double>(values.size()));
}

namespace {

// Mean square of what lies in 20 to 400 Hz, by direct Fourier sums.
double felt_power(std::span<const double> signal) {
  const auto n = static_cast<double>(signal.size());
  double power = 0.0;
  for (auto k = static_cast<int>(20.0 * n / 1000.0); k <= static_cast<int>(400.0 * n / 1000.0);
       ++k) {
    const std::complex<double> turn = std::polar(1.0, -2.0 * std::numbers::pi * k / n);
    std::complex<double> phase = 1.0;
    std::complex<double> sum = 0.0;
    for (const double value : signal) {
      sum += value * phase;
      phase *= turn;
    }
    power += 2.0 * std::norm(sum) / (n * n);
  }
  return power;
}

constexpr double z = 1.959964;  // of the normal distribution, 95 % between -z and z

// The same of Student's distribution, from one degree of freedom on.
constexpr std::array student_t = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365,
                                  2.306,  2.262, 2.228, 2.201, 2.179, 2.160, 2.145,
                                  2.131,  2.120, 2.110, 2.101, 2.093, 2.086};

}  // namespace

double felt_rms(const std::vector<double>& signal) {
  constexpr std::size_t block = 1000;
  double power = 0.0;
  std::size_t blocks = 0;
  for (std::size_t begin = 0; begin + block <= signal.size(); begin += block, ++blocks)
    power += felt_power({signal.data() + begin, block});
  return blocks == 0 ? 0.0 : std::sqrt(power / static_cast<double>(blocks));
}

double felt_rms_of_all(const std::vector<double>& signal) {
  return signal.empty() ? 0.0 : std::sqrt(felt_power(signal));
}

Interval wilson(std::size_t successes, std::size_t of) {
  const auto n = static_cast<double>(of);
  const double share = static_cast<double>(successes) / n;
  const double middle = (share + z * z / (2.0 * n)) / (1.0 + z * z / n);
  const double half =
      z / (1.0 + z * z / n) * std::sqrt(share * (1.0 - share) / n + z * z / (4.0 * n * n));
  // The bounds are exact at the ends; rounding must not put the share outside.
  return {share, std::min(share, std::max(0.0, middle - half)),
          std::max(share, std::min(1.0, middle + half))};
}

Interval mean_of(std::span<const Interval> parts) {
  double sum = 0.0;
  double below = 0.0;
  double above = 0.0;
  for (const Interval& part : parts) {
    sum += part.value;
    below += (part.value - part.low) * (part.value - part.low);
    above += (part.high - part.value) * (part.high - part.value);
  }
  const auto n = static_cast<double>(parts.size());
  return {sum / n, (sum - std::sqrt(below)) / n, (sum + std::sqrt(above)) / n};
}

Interval student(std::span<const double> repeats) {
  const auto n = static_cast<double>(repeats.size());
  const double mean = lab::mean(repeats);
  if (repeats.size() < 2) {
    const double infinite = std::numeric_limits<double>::infinity();
    return {mean, -infinite, infinite};
  }
  double squares = 0.0;
  for (const double value : repeats) squares += (value - mean) * (value - mean);
  const std::size_t freedom = repeats.size() - 1;
  const double t = freedom <= student_t.size() ? student_t[freedom - 1] : student_t.back();
  const double half = t * std::sqrt(squares / (n - 1.0) / n);
  return {mean, mean - half, mean + half};
}

}  // namespace palpate::lab
