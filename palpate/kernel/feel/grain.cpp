// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/feel/grain.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "palpate/kernel/core/mathematics.hpp"

namespace palpate {
namespace {

// [-] of the ticks' rate: a frequency above half of it would come out as another.
constexpr double highest_share = 0.4;
// [-] frequency over `lowest`, from which the vibration has all of its strength.
constexpr double all_of_it = 2.0;
// [-] by which a frequency may change until its pole is computed again: a sixth of a semitone.
constexpr double same_turn = 0.01;

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
    real_ = imaginary_ = 0.0;
    return 0.0;
  }
  const double turn = 2.0 * std::numbers::pi * std::min(wanted, top) * dt;
  if (std::abs(turn - turn_) > same_turn * turn_) {
    turn_ = turn;
    const double decay = math::exp(-half_width * turn);
    pole_real_ = decay * math::cos(turn);
    pole_imaginary_ = decay * math::sin(turn);
    kick_ = std::sqrt(1.0 - decay * decay);
  }
  const double real = real_;
  real_ = pole_real_ * real - pole_imaginary_ * imaginary_ + kick_ * noise();
  imaginary_ = pole_imaginary_ * real + pole_real_ * imaginary_ + kick_ * noise();
  const double strength = std::clamp((wanted / lowest - 1.0) / (all_of_it - 1.0), 0.0, 1.0);
  return strength * real_;
}

}  // namespace palpate
