// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/teleop/robot.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "palpate/kernel/core/rotation.hpp"

namespace palpate {

namespace {

constexpr double loop_rate = 2.0 * std::numbers::pi * 4.0;  // [rad/s] as labs have measured it

}  // namespace

void SimulatedTurn::follow(const Rotation& wanted, double dt) noexcept {
  const Vec3 left = rotation_vector(between(wanted, orientation));
  spin += dt * loop_rate * (loop_rate * left - 2.0 * spin);
  orientation = unit(product(rotation_by(dt * spin), orientation));
}

double SimulatedTool::stiffness() { return mass * loop_rate * loop_rate; }

double SimulatedTool::damping() { return 2.0 * std::sqrt(stiffness() * mass); }

template <class Force>
void SimulatedTool::advance(const Force& force, double t, double dt) {
  constexpr int substeps = 10;
  const double step = dt / substeps;
  for (int i = 1; i <= substeps; ++i) {
    const Surface at = surfaces_(x_, t - dt + i * step);
    depth_ = std::max(radius - at.distance, 0.0);
    contact_ = surface_stiffness * depth_ * at.normal;
    v_ += step / mass * (force() + contact_);
    x_ += step * v_;
  }
}

void SimulatedTool::lead_to(const Vec3& place, double t, double dt) {
  advance([&] { return Vec3(stiffness() * (place - x_) - damping() * v_); }, t, dt);
}

void SimulatedTool::push(const Vec3& force, double t, double dt) {
  advance([&] { return force; }, t, dt);
}

}  // namespace palpate
