// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/energy_monitor.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

// [s] People tap at up to about 7 Hz: faster cycles are not voluntary.
constexpr double voluntary = 0.125;
// [s] Cycles slower than 1.7 Hz leave a person time to release the handle.
constexpr double longest_cycle = 0.6;
// [1/s] times the period of the ticks: of the elastic energy of a cycle, the share that a surface
// sampled at that rate with a tick of delay generates when it is pressed at 12 Hz, the quickest
// tremor: pi/2 * 1.5 T * 2 pi 12 Hz. A released handle oscillates faster and generates more: 0.2 to
// 0.5 of it at 14 to 20 Hz and 1 kHz.
constexpr double quick_share = 178.0;
// [-] the same for slower cycles, whatever the rate. Taps at 7 Hz with a light and hard contact
// generate up to 0.3.
constexpr double slow_share = 0.35;
// [cycles] that a slow cycle counts for: what is slow has more time to happen at random.
constexpr double slow_weight = 0.5;
// [-] of those shares, enough while a cut is in force: a surface that was made softer swings more
// slowly and generates less, and that a hand was there to do it is no longer likely.
constexpr double suspected_share = 0.3;
// [N] A smaller swing of the force is not felt as an oscillation.
constexpr double least_force_swing = 0.1;
// [-] from one cycle to the next. What dies away by itself falls faster; what a person or noise
// does is less regular.
constexpr double sustained = 0.85;
constexpr double regular = 1.4;

}  // namespace

// Hazard: slow-oscillation
bool EnergyMonitor::run(double dt, const Vec3& sent, const Vec3& hip, const Vec3& normal,
                        double velocity, const Limits& limits) noexcept {
  if (!normal.isZero()) normal_ = normal.normalized();
  const Vec3 moved = started_ ? Vec3(hip - last_hip_ - velocity * dt * normal_) : Vec3::Zero();
  started_ = true;
  last_hip_ = hip;
  t_ += dt;
  ticks_ += 1.0;
  energy_ += delayed_force_.dot(moved);
  height_ += moved.dot(normal_);
  delayed_force_ = sent;

  const double force = sent.norm();
  least_force_ = std::min(least_force_, force);
  most_force_ = std::max(most_force_, force);
  bottom_ = std::min(bottom_, height_);
  least_energy_ = std::min(least_energy_, energy_);
  if (t_ - began_.t > longest_cycle) generating_ = 0.0;

  if (rising_) {
    if (height_ >= top_.height) top_ = {t_, height_, energy_, force, hip};
    if (top_.height - height_ <= limits.distance) return false;
    rising_ = false;
    lowest_ = height_;
    return close_cycle(limits);
  }
  lowest_ = std::min(lowest_, height_);
  if (height_ - lowest_ > limits.distance) {
    rising_ = true;
    top_ = {t_, height_, energy_, force, hip};
  }
  return false;
}

// Is the cycle from the last top to this one part of an oscillation?
bool EnergyMonitor::generates(const Top& top, bool suspected) const noexcept {
  const double duration = top.t - began_.t;
  const double swing = 0.5 * (top.height + began_.height) - bottom_;
  const double force_swing = most_force_ - least_force_;
  if (duration > longest_cycle || force_swing < least_force_swing) return false;
  if (swing < sustained * last_cycle_.swing) return false;
  if (duration > regular * last_cycle_.duration || last_cycle_.duration > regular * duration)
    return false;
  const Vec3 gone = top.hip - began_.hip;
  if ((gone - gone.dot(normal_) * normal_).norm() > swing) return false;
  // What is stored in the surface at the tops is not lost yet: a spring of stiffness dF/ds.
  const double stored =
      0.5 * swing / force_swing * (top.force * top.force - began_.force * began_.force);
  const double gained = top.energy - began_.energy + stored;
  const double share = (suspected ? suspected_share : 1.0) *
                       (duration < voluntary ? quick_share * duration / ticks_ : slow_share);
  // Both are too much where the surface is left in each cycle, or is never left.
  const double absorbed = 0.5 * (top.energy + began_.energy) - least_energy_;
  return gained > share * std::min(0.5 * force_swing * swing, absorbed);
}

bool EnergyMonitor::close_cycle(const Limits& limits) noexcept {
  const bool counts = has_began_ && generates(top_, limits.suspected);
  const double duration = top_.t - began_.t;
  generating_ = counts ? generating_ + (duration < voluntary ? 1.0 : slow_weight) : 0.0;
  last_cycle_ = {duration, 0.5 * (top_.height + began_.height) - bottom_};
  began_ = top_;
  has_began_ = true;
  bottom_ = height_;
  least_energy_ = energy_;
  ticks_ = 0.0;
  least_force_ = most_force_ = delayed_force_.norm();
  if (generating_ < limits.count) return false;
  generating_ = 0.0;
  return true;
}

}  // namespace palpate
