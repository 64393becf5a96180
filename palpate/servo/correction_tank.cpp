// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/correction_tank.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

// [J] that the tank holds at most: what a device of 3.3 N takes over 15 mm.
constexpr double fullest = 0.05;
// [s] without a force, after which another contact begins, with an empty tank.
constexpr double apart = 0.02;

}  // namespace

double CorrectionTank::run(const Input& input) noexcept {
  const Vec3 moved =
      started_ ? Vec3(input.hip - hip_ - input.dt * input.surface) : Vec3(Vec3::Zero());
  const double stiffness_before = started_ ? stiffness_ : input.stiffness;
  started_ = true;
  hip_ = input.hip;
  stiffness_ = input.stiffness;
  if (input.new_frame) of_frame_ = input.frame_work;
  if (!(input.stiffness > 0.0 && stiffness_before > 0.0)) return 1.0;

  const bool pushes = !input.force.isZero(0.0) || !input.last.isZero(0.0);
  apart_ = pushes ? 0.0 : apart_ + input.dt;
  if (apart_ > apart) level_ = 0.0;
  if (!pushes) return 1.0;

  // A share x of the force holds a x^2. The hand pressed in minus the mean force of both ticks
  // times its motion, so that what the hold of a tick makes, on an exact surface too, is no
  // correction: x puts in a x^2 + b x + c.
  const double a = 0.5 * input.force.squaredNorm() / input.stiffness;
  const double b = 0.5 * input.force.dot(moved);
  const double c = 0.5 * input.last.dot(moved) - 0.5 * input.last.squaredNorm() / stiffness_before;
  const double most = of_frame_ + level_;
  double share = 1.0;
  if (a > 0.0 && a + b + c > most) {
    const double root = std::sqrt(std::max(b * b - 4.0 * a * (c - most), 0.0));
    share = std::clamp((root - b) / (2.0 * a), 0.0, 1.0);
  }
  double put_in = (a * share + b) * share + c;
  if (put_in > 0.0) {
    const double free = std::min(put_in, of_frame_);
    of_frame_ -= free;
    put_in -= free;
  }
  level_ = std::clamp(level_ - put_in, 0.0, fullest);
  return share;
}

}  // namespace palpate
