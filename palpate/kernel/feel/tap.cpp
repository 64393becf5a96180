// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/feel/tap.hpp"

#include <algorithm>
#include <numbers>

#include "palpate/kernel/core/mathematics.hpp"

namespace palpate {
namespace {

// [s] over which the ringing ends, however little has died away: no step at its end.
constexpr double ending = 0.01;

}  // namespace

Vec3 Tap::update(double pressed, const Vec3& normal, double approach, const TapParameters& material,
                 double t) noexcept {
  const bool touching = pressed > 0.0;
  const bool begins = touching && t - touched_at_ >= apart && t - struck_at_ >= rest;
  if (touching) touched_at_ = t;
  if (begins && material.tap > 0.0 && approach >= least_speed) {
    struck_at_ = t;
    size_ = std::min(material.tap * approach, largest);
    material_ = material;
  }
  const double since = t - struck_at_;
  if (!(since >= 0.0 && since < longest)) return Vec3::Zero();
  const double left = std::min((longest - since) / ending, 1.0);
  const double ringing = size_ * left * math::exp(-material_.tap_decay * since) *
                         math::cos(2.0 * std::numbers::pi * material_.tap_frequency * since);
  return ringing * normal;
}

}  // namespace palpate
