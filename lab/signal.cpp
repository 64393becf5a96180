// SPDX-License-Identifier: Apache-2.0
#include "lab/signal.hpp"

#include <cmath>
#include <complex>
#include <numbers>

namespace palpate::lab {

double rms(const std::vector<double>& values) {
  double squares = 0.0;
  for (const double v : values) squares += v * v;
  return values.empty() ? 0.0 : std::sqrt(squares / static_cast<double>(values.size()));
}

// By direct Fourier sums over blocks of one second.
double felt_rms(const std::vector<double>& signal) {
  constexpr std::size_t block = 1000;
  double power = 0.0;
  std::size_t blocks = 0;
  for (std::size_t begin = 0; begin + block <= signal.size(); begin += block, ++blocks) {
    for (int f = 20; f <= 400; ++f) {
      const std::complex<double> turn =
          std::polar(1.0, -2.0 * std::numbers::pi * f / double{block});
      std::complex<double> phase = 1.0;
      std::complex<double> sum = 0.0;
      for (std::size_t i = 0; i < block; ++i) {
        sum += signal[begin + i] * phase;
        phase *= turn;
      }
      power += 2.0 * std::norm(sum) / (double{block} * double{block});
    }
  }
  return blocks == 0 ? 0.0 : std::sqrt(power / static_cast<double>(blocks));
}

}  // namespace palpate::lab
