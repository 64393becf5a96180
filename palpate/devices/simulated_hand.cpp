// SPDX-License-Identifier: Apache-2.0
#include "palpate/devices/simulated_hand.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string_view>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

constexpr double longest_step = 1e-4;                   // [s]
constexpr double longest_gap = 0.1;                     // [s] of simulated time per read
constexpr std::array<double, 3> tones{8.3, 9.7, 11.9};  // [Hz] physiological tremor
constexpr double shake_from = 20.0;                     // [Hz] no hand moves so fast by itself
constexpr double shake_time = 0.25;                     // [s]

void check(std::string_view name, double value, double min, double max, std::string_view unit) {
  if (value >= min && value <= max) return;
  throw Error("simulated hand: " + std::string(name),
              std::to_string(value) + " " + std::string(unit) + " is out of range",
              "give a value from " + std::to_string(min) + " to " + std::to_string(max));
}

void keep_largest(std::atomic<double>& largest, double value) noexcept {
  if (value > largest.load(std::memory_order_relaxed))
    largest.store(value, std::memory_order_relaxed);
}

}  // namespace

SimulatedHand::SimulatedHand(HipPath target, const HandModel& model, std::string uri)
    : info_{.uri = std::move(uri), .kind = "simulated hand", .limits = no_motors},
      path_(std::move(target)),
      model_(model) {
  check("mass", model_.mass, 0.01, 10.0, "kg");
  check("stiffness", model_.stiffness, 1.0, 1e4, "N/m");
  check("damping", model_.damping, 0.0, 1e3, "N s/m");
  check("tremor", model_.tremor, 0.0, 0.01, "m");
  std::mt19937_64 random(model_.seed);
  for (Vec3& phase : phases_) {
    for (int axis = 0; axis < 3; ++axis)
      phase[axis] = 2.0 * std::numbers::pi * static_cast<double>(random() >> 11) * 0x1p-53;
  }
  target_ = this->target(0.0);
  position_ = target_;
  slow_ = slower_ = position_;
}

Vec3 SimulatedHand::target(double t) const noexcept {
  Vec3 target = path_.at(path_.first_time() + t);
  for (std::size_t i = 0; i < tones.size(); ++i) {
    const Vec3 angle = phases_[i].array() + 2.0 * std::numbers::pi * tones[i] * t;
    // The three tones together stay within `tremor` along each axis.
    target += model_.tremor / static_cast<double>(tones.size()) * Vec3(angle.array().sin());
  }
  return target;
}

void SimulatedHand::step(double dt) noexcept {
  t_ += dt;
  const Vec3 next = target(t_);
  const Vec3 target_velocity = (next - target_) / dt;
  target_ = next;
  // The damper implicitly, so that a stiff one is stable; the spring with the new velocity.
  const Vec3 pull =
      force_ + model_.stiffness * (target_ - position_) + model_.damping * target_velocity;
  velocity_ = (velocity_ + dt / model_.mass * pull) / (1.0 + dt * model_.damping / model_.mass);
  position_ += dt * velocity_;
  work_ += dt * force_.dot(velocity_);

  const double follow = -std::expm1(-2.0 * std::numbers::pi * shake_from * dt);
  slow_ += follow * (position_ - slow_);
  slower_ += follow * (slow_ - slower_);
  const Vec3 fast = position_ - 2.0 * slow_ + slower_;  // high-passed twice
  squared_shake_ += -std::expm1(-dt / shake_time) * (fast.squaredNorm() - squared_shake_);
}

HandState SimulatedHand::read(double t) noexcept {
  if (!began_) {
    began_ = true;
    began_at_ = t;
  }
  const double until = t - began_at_;
  if (until - t_ > longest_gap) began_at_ += until - t_ - longest_gap;
  const double gap = std::min(until - t_, longest_gap);
  if (gap > 0.0) {
    const int steps = static_cast<int>(std::ceil(gap / longest_step));
    for (int i = 0; i < steps; ++i) step(gap / steps);
    statistics_.work.store(work_, std::memory_order_relaxed);
    keep_largest(statistics_.most_work, work_);
    statistics_.shake.store(std::sqrt(squared_shake_), std::memory_order_relaxed);
    keep_largest(statistics_.most_shake, std::sqrt(squared_shake_));
    keep_largest(statistics_.top_speed, velocity_.norm());
  }
  return {.position = position_};
}

void SimulatedHand::write(const Vec3& force, double /*t*/) noexcept {
  if (force.allFinite()) force_ = force;
}

}  // namespace palpate
