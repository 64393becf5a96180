// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/devices/sampled_wall.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

// Do a matrix's powers vanish? Each is the square of the one before: its eigenvalues would say the
// same, but take ten times as long to compile.
bool vanishes(Eigen::MatrixXd power) {
  constexpr int squarings = 30;      // what neither grows nor shrinks by 1e-8 counts as resting
  constexpr double endless = 1e150;  // its square is still a number
  for (int i = 0; i < squarings; ++i) {
    const double size = power.norm();
    if (size < 1.0) return true;
    if (!(size < endless)) return false;
    power = power.lazyProduct(power).eval();
  }
  return false;
}

// One tick of the loop as a matrix over place and velocity of the handle, its place in the tick
// before, its filtered velocity, and the forces of the ticks before, the newest first.
bool decays(const SampledWall& wall, double stiffness) {
  const double late = std::floor(wall.delay / wall.period + 1e-9);
  const auto whole = static_cast<Eigen::Index>(late);  // ticks of delay
  const double rest = std::max(wall.delay - late * wall.period, 0.0);
  const Eigen::Index size = 4 + whole + 1;
  const double share = wall.filter > 0.0 ? -std::expm1(-wall.period / wall.filter) : 1.0;

  Eigen::RowVectorXd velocity = Eigen::RowVectorXd::Zero(size);
  velocity[0] = share / wall.period;
  velocity[2] = -share / wall.period;
  velocity[3] = 1.0 - share;
  Eigen::RowVectorXd force = -wall.damping * velocity;
  force[0] -= stiffness;
  const auto force_before = [&](Eigen::Index ticks) {
    if (ticks == 0) return force;
    return Eigen::RowVectorXd(Eigen::RowVectorXd::Unit(size, 3 + ticks));
  };
  Eigen::MatrixXd state = Eigen::MatrixXd::Identity(size, size).topRows(2);
  const auto pass = [&](double time, const Eigen::RowVectorXd& held) {
    const ExactStep step(wall.handle, time);
    for (Eigen::Index column = 0; column < size; ++column) {
      Vec3 y = state(0, column) * Vec3::UnitX();
      Vec3 v = state(1, column) * Vec3::UnitX();
      step.advance(y, v, held[column] * Vec3::UnitX());
      state(0, column) = y.x();
      state(1, column) = v.x();
    }
  };
  if (rest > 0.0) pass(rest, force_before(whole + 1));
  pass(wall.period - rest, force_before(whole));

  Eigen::MatrixXd tick = Eigen::MatrixXd::Zero(size, size);
  tick.topRows(2) = state;
  tick(2, 0) = 1.0;
  tick.row(3) = velocity;
  for (Eigen::Index i = 1; i <= whole + 1; ++i) tick.row(3 + i) = force_before(i - 1);
  return vanishes(tick);
}

}  // namespace

double linear_stiffness(const SampledWall& wall, double most) {
  constexpr double softest = 1.0;  // [N/m]
  constexpr double coarse = 1.1;
  constexpr double fine = 1.001;
  if (!decays(wall, softest)) return 0.0;
  double low = softest;
  while (low < most && decays(wall, coarse * low)) low *= coarse;
  double high = coarse * low;
  while (high > fine * low) {
    const double middle = std::sqrt(low * high);
    (decays(wall, middle) ? low : high) = middle;
  }
  return std::min(low, most);
}

}  // namespace palpate
