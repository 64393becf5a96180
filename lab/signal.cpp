// SPDX-License-Identifier: Apache-2.0
#include "lab/signal.hpp"

#include <cmath>
#include <complex>
#include <numbers>
#include <span>

namespace palpate::lab {

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

}  // namespace palpate::lab
