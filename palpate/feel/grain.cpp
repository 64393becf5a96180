// SPDX-License-Identifier: Apache-2.0
#include "palpate/feel/grain.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate {
namespace {

// [-] of the ticks' rate: a frequency above half of it would come out as another.
constexpr double highest_share = 0.4;
// [-] frequency over `lowest`, from which the vibration has all of its strength.
constexpr double all_of_it = 2.0;

}  // namespace

// Four uniform numbers are nearly normal, and bounded.
double Grain::noise() noexcept {
  random_ ^= random_ << 13;
  random_ ^= random_ >> 7;
  random_ ^= random_ << 17;
  double sum = 0.0;
  for (unsigned i = 0; i < 4; ++i) sum += static_cast<double>(random_ >> (16 * i) & 0xffffU);
  constexpr double mean = 2.0 * 65535.0;
  constexpr double sd = 37837.2;  // of the sum: 65536 / sqrt(3)
  return (sum - mean) / sd;
}

double Grain::update(double length, double speed, double dt) noexcept {
  const double wanted = speed / length;
  const double top = dt > 0.0 ? std::min(highest, highest_share / dt) : lowest;
  if (!(wanted > lowest) || !(top > lowest)) {
    z_ = 0.0;
    return 0.0;
  }
  const double frequency = std::min(wanted, top);
  const double angle = 2.0 * std::numbers::pi * frequency * dt;
  const double decay = std::exp(-half_width * angle);
  const double kick = std::sqrt((1.0 - decay * decay));
  const double real = noise();
  const double imaginary = noise();
  z_ = std::polar(decay, angle) * z_ + kick * std::complex<double>(real, imaginary);
  const double strength = std::clamp((wanted / lowest - 1.0) / (all_of_it - 1.0), 0.0, 1.0);
  return strength * z_.real();
}

}  // namespace palpate
