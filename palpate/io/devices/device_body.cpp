// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/devices/device_body.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/pose.hpp"

namespace palpate {
namespace {

// Figures measured on, or published for, devices of the kind; the middle where they vary.
// Touch: 45 to 75 g, 0.5 to 1 N s/m. omega: 0.2 to 0.25 kg, 1 to 2 N s/m, updated at 4 kHz.
// No separate continuous force is known of omega and Falcon.
// Of the body: mass, damping, friction, resolution, delay, inertia and damping of turning; of the
// limits: force, continuous force, stiffness, damping, motors, torque; the reach.
constexpr std::array presets{
    DevicePreset{"touch", {0.06, 0.7, 0.26, 0.055e-3, 1e-3}, {3.3, 0.88, 500.0}, 0.075},
    DevicePreset{"omega", {0.225, 1.5, 0.05, 0.01e-3, 0.25e-3}, {12.0, 12.0, 5000.0, 30.0}, 0.075},
    DevicePreset{"falcon", {0.25, 1.0, 0.4, 0.06e-3, 1e-3}, {8.0, 8.0, 3000.0, 20.0}, 0.04},
    DevicePreset{"sigma",
                 {0.3, 1.5, 0.05, 0.01e-3, 0.25e-3, 1e-4, 1e-3},
                 {12.0, 12.0, 4000.0, 30.0, true, 0.4},
                 0.075},
};

constexpr std::array grips{
    Grip{"light", 0.05, 100.0, 2.0, 0.2, 2e-3},
    Grip{"firm", 0.2, 600.0, 12.0, 1.0, 1e-2},
    Grip{"none", 0.0, 0.0, 0.0, 0.0, 0.0},
};

template <class Rows>
const auto& row_of(const Rows& rows, std::string_view name, const char* noun,
                   const std::string& others) {
  std::string known = others;
  for (const auto& row : rows) {
    if (row.name == name) return row;
    known += (known.empty() ? "" : ", ") + std::string(row.name);
  }
  throw Error(std::string(noun) + " '" + std::string(name) + "'", "there is no such model",
              "choose one of: " + known);
}

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

void validate(const DeviceBody& body) {
  check_range("device model", "mass", "kg", 1e-3, 10.0, body.mass);
  check_range("device model", "damping", "N s/m", 0.0, 100.0, body.damping);
  check_range("device model", "friction", "N", 0.0, 10.0, body.friction);
  check_range("device model", "resolution", "m", 0.0, 0.01, body.resolution);
  check_range("device model", "delay", "s", 0.0, 0.01, body.delay);
  check_range("device model", "inertia", "kg m^2", 0.0, 0.1, body.inertia);
  check_range("device model", "turn_damping", "N m s/rad", 0.0, 1.0, body.turn_damping);
}

const DevicePreset& device_preset(std::string_view name) {
  return row_of(presets, name, "device model", "none");
}

const Grip& grip_preset(std::string_view name) { return row_of(grips, name, "grip", ""); }

ExactStep::ExactStep(const MassSpringDamper& system, double dt) noexcept {
  const double m = system.mass;
  const double decay = system.damping / (2.0 * m);
  if (system.stiffness > 0.0) {
    // z = y - g/k: z1 = e^(-a t) ((c + a s) z + s v), v1 = e^(-a t) ((c - a s) v - k/m s z)
    const double squared = system.stiffness / m - decay * decay;
    const double w = std::sqrt(std::abs(squared));
    double c = 1.0;
    double s = dt;
    if (w * dt > 1e-6) {
      c = squared > 0.0 ? std::cos(w * dt) : std::cosh(w * dt);
      s = (squared > 0.0 ? std::sin(w * dt) : std::sinh(w * dt)) / w;
    }
    const double e = std::exp(-decay * dt);
    yy_ = e * (c + decay * s);
    yv_ = e * s;
    vy_ = -e * system.stiffness / m * s;
    vv_ = e * (c - decay * s);
    yg_ = (1.0 - yy_) / system.stiffness;
    vg_ = -vy_ / system.stiffness;
    return;
  }
  // No spring: the velocity decays towards g/b.
  const double rate = system.damping / m;
  const double x = rate * dt;
  vv_ = std::exp(-x);
  const bool tiny = x < 1e-4;
  yv_ = tiny ? dt * (1.0 - x / 2.0 + x * x / 6.0) : -std::expm1(-x) / rate;
  yg_ = (tiny ? dt * dt * (0.5 - x / 6.0 + x * x / 24.0) : (dt - yv_) / rate) / m;
  vg_ = yv_ / m;
}

void ExactStep::advance(Vec3& y, Vec3& v, const Vec3& g) const noexcept {
  const Vec3 y0 = y;
  const Vec3 v0 = v;
  y = yy_ * y0 + yv_ * v0 + yg_ * g;
  v = vy_ * y0 + vv_ * v0 + vg_ * g;
}

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
