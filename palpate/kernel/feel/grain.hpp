// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace palpate {

/// The vibration of a rough surface under a sliding hand: an autoregressive process whose poles
/// follow the speed.
///
/// A complex process of first order, z' = exp((-g + 2 pi i f) dt) z + noise, whose real part has
/// the spectrum of a resonance at f = speed / length, whose width follows its frequency. It is
/// discretised exactly, so that its spectrum does not depend on the rate of the ticks. At rest and
/// below 20 Hz, where it would be a swaying, it is silent; above 0.4 of the ticks' rate it stays
/// there.
///
/// Its noise is made by a generator with a fixed seed: the same strokes feel the same, bit for bit.
///
/// [servo] Nothing here allocates, locks or throws.
class Grain {
 public:
  static constexpr double lowest = 20.0;    ///< [Hz]
  static constexpr double highest = 400.0;  ///< [Hz]
  /// [-] g / (2 pi f): half the width of the resonance over its frequency.
  static constexpr double half_width = 0.5;

  void reset() noexcept { *this = {}; }

  /// @param length  [m] of the grains
  /// @param speed   [m/s] of sliding
  /// @param dt      [s] since the last call
  /// @return [-] of variance 1 while the hand slides; 0 at rest
  double update(double length, double speed, double dt) noexcept;

 private:
  double noise() noexcept;  // [-] of variance 1 and at most 3.5

  double real_ = 0.0, imaginary_ = 0.0;  // z
  // The pole exp((-g + 2 pi i f) dt) and the noise's size, for the turn 2 pi f dt.
  double turn_ = 0.0, pole_real_ = 1.0, pole_imaginary_ = 0.0, kick_ = 0.0;
  std::uint64_t random_ = 0x9e3779b97f4a7c15ULL;
};

}  // namespace palpate
