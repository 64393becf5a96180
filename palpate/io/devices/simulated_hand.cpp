// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/devices/simulated_hand.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/rotation.hpp"

namespace palpate {
namespace {

constexpr double longest_step = 1e-4;                   // [s]
constexpr double longest_gap = 0.1;                     // [s] of simulated time per read
constexpr std::array<double, 3> tones{8.3, 9.7, 11.9};  // [Hz] physiological tremor
constexpr double shake_from = 20.0;                     // [Hz] no hand moves so fast by itself
constexpr double shake_time = 0.25;                     // [s]

void keep_largest(std::atomic<double>& largest, double value) noexcept {
  if (value > largest.load(std::memory_order_relaxed))
    largest.store(value, std::memory_order_relaxed);
}

}  // namespace

SimulatedHand::SimulatedHand(HipPath target, const HandModel& model, std::string uri)
    : info_{.uri = std::move(uri),
            .kind = "simulated hand",
            .limits = no_motors,
            .simulated = true},
      path_(std::move(target)),
      model_(model) {
  const bool held = !model_.body || model_.mass > 0.0;
  check_range("simulated hand", "mass", "kg", held ? 0.01 : 0.0, 10.0, model_.mass);
  check_range("simulated hand", "stiffness", "N/m", model_.body ? 0.0 : 1.0, 1e4, model_.stiffness);
  check_range("simulated hand", "damping", "N s/m", 0.0, 1e3, model_.damping);
  check_range("simulated hand", "tremor", "m", 0.0, 0.01, model_.tremor);
  check_range("simulated hand", "turn_stiffness", "N m/rad", 0.0, 100.0, model_.turn_stiffness);
  check_range("simulated hand", "turn_damping", "N m s/rad", 0.0, 1.0, model_.turn_damping);
  if (const auto& body = model_.body) {
    validate(*body);
    info_.kind = "simulated hand on a device";
    info_.damping = body->damping;
    info_.delay = body->delay;
    system_ = {model_.mass + body->mass, model_.damping + body->damping, model_.stiffness};
  }
  std::mt19937_64 random(model_.seed);
  for (Vec3& phase : phases_) {
    for (int axis = 0; axis < 3; ++axis)
      phase[axis] = 2.0 * std::numbers::pi * static_cast<double>(random() >> 11) * 0x1p-53;
  }
  target_ = this->target(0.0);
  position_ = target_;
  slow_ = slower_ = position_;
  orientation_ = target_orientation_ = path_.pose_at(path_.first_time()).orientation;
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
  keep_shake(dt);
}

// The same with the device's body: the exact solution under the forces that are constant over the
// step, until the motion ends; friction then holds it or lets it go the other way.
void SimulatedHand::step_body(double dt) noexcept {
  take_due_force();
  t_ += dt;
  const Vec3 next = target(t_);
  const Vec3 target_velocity = (next - target_) / dt;
  slide(dt, target_velocity);
  target_ = next;
  if (turns()) turn(dt);
  keep_shake(dt);
}

void SimulatedHand::slide(double dt, const Vec3& target_velocity) noexcept {
  const DeviceBody& body = *model_.body;
  constexpr int most_stops = 3;  // in one step; a fourth ends it
  double left = dt;
  double into = 0.0;  // [s] of the step
  for (int stop = 0; stop < most_stops && left > 0.0; ++stop) {
    // Relative to the target, which moves in a straight line, the system is linear.
    const Vec3 target_now = target_ + into * target_velocity;
    const Vec3 pull = force_ + model_.stiffness * (target_now - position_) +
                      model_.damping * (target_velocity - velocity_) - body.damping * velocity_;
    const bool resting = velocity_.isZero(0.0);
    if (resting && pull.norm() <= body.friction) return;
    const Vec3 along = (resting ? pull : velocity_).normalized();
    const Vec3 friction = -body.friction * along;
    const Vec3 constant = force_ + friction - body.damping * target_velocity;
    const auto flow = [&](double time, Vec3& position, Vec3& velocity) {
      if (time != exact_dt_) {
        exact_step_ = ExactStep(system_, time);
        exact_dt_ = time;
      }
      Vec3 y = position_ - target_now;
      Vec3 v = velocity_ - target_velocity;
      exact_step_.advance(y, v, constant);
      position = y + target_now + time * target_velocity;
      velocity = v + target_velocity;
    };
    Vec3 position;
    Vec3 velocity;
    double time = left;
    flow(time, position, velocity);
    const double end_speed = velocity.dot(along);
    if (body.friction > 0.0 && end_speed < 0.0) {
      // It stops within the step: the deceleration is nearly constant until then.
      const double speed = velocity_.dot(along);
      time = left * speed / (speed - end_speed);
      if (time > 0.0) {
        flow(time, position, velocity);
      } else {
        position = position_;
      }
      velocity.setZero();
    }
    const Vec3 moved = position - position_;
    work_ += force_.dot(moved);
    friction_loss_ -= friction.dot(moved);
    damping_loss_ += body.damping * time / 3.0 *
                     (velocity_.squaredNorm() + velocity_.dot(velocity) + velocity.squaredNorm());
    position_ = position;
    velocity_ = velocity;
    left -= time;
    into += time;
    if (!velocity.isZero(0.0)) return;
  }
}

void SimulatedHand::turn(double dt) noexcept {
  const Rotation next = path_.pose_at(path_.first_time() + t_).orientation;
  const Vec3 target_rate = rotation_vector(between(next, target_orientation_)) / dt;
  target_orientation_ = next;
  const double inertia = model_.body->inertia;
  const double damping = model_.turn_damping + model_.body->turn_damping;
  const Vec3 pull = torque_ + model_.turn_damping * target_rate +
                    model_.turn_stiffness * rotation_vector(between(next, orientation_));
  turn_rate_ = (turn_rate_ + dt / inertia * pull) / (1.0 + dt * damping / inertia);
  orientation_ = unit(product(rotation_by(dt * turn_rate_), orientation_));
}

void SimulatedHand::take_due_force() noexcept {
  constexpr double rounding = 0.5e-6;  // [s]
  while (command_count_ > 0 && commands_[first_command_].due <= t_ + rounding) {
    force_ = commands_[first_command_].wrench.force;
    torque_ = commands_[first_command_].wrench.torque;
    first_command_ = (first_command_ + 1) % commands_.size();
    --command_count_;
  }
}

void SimulatedHand::launch(const Vec3& position, const Vec3& velocity) noexcept {
  position_ = position;
  velocity_ = velocity;
  slow_ = slower_ = position;
}

void SimulatedHand::set_device(const DevicePreset& preset) {
  info_.kind = "simulated hand on a device: " + std::string(preset.name);
  info_.limits = preset.limits;
  info_.reach = DeviceReach::ball(preset.reach);
}

void SimulatedHand::keep_shake(double dt) noexcept {
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
    if (!enabled_.load(std::memory_order_relaxed)) {
      force_ = torque_ = Vec3::Zero();
      command_count_ = 0;
    }
    for (int i = 0; i < steps; ++i) {
      if (model_.body) {
        step_body(gap / steps);
      } else {
        step(gap / steps);
      }
    }
    statistics_.work.store(work_, std::memory_order_relaxed);
    keep_largest(statistics_.most_work, work_);
    statistics_.shake.store(std::sqrt(squared_shake_), std::memory_order_relaxed);
    keep_largest(statistics_.most_shake, std::sqrt(squared_shake_));
    keep_largest(statistics_.top_speed, velocity_.norm());
    if (model_.body) {
      statistics_.friction_loss.store(friction_loss_, std::memory_order_relaxed);
      statistics_.damping_loss.store(damping_loss_, std::memory_order_relaxed);
      statistics_.kinetic.store(0.5 * system_.mass * velocity_.squaredNorm(),
                                std::memory_order_relaxed);
      statistics_.turn_rate.store(turn_rate_.norm(), std::memory_order_relaxed);
    }
  }
  HandState hand{.position = position_};
  const double resolution = model_.body ? model_.body->resolution : 0.0;
  if (resolution > 0.0) hand.position = resolution * Vec3((position_ / resolution).array().round());
  if (turns()) {
    hand.orientation = Eigen::Quaterniond(orientation_);
  } else if (path_.turns()) {
    hand.orientation = Eigen::Quaterniond(path_.pose_at(path_.first_time() + t_).orientation);
  }
  return hand;
}

void SimulatedHand::write(const Wrench& wrench, double /*t*/) noexcept {
  const bool finite = wrench.force.allFinite() && wrench.torque.allFinite();
  if (!finite || !enabled_.load(std::memory_order_relaxed)) return;
  if (!model_.body) {
    force_ = wrench.force;
    return;
  }
  if (command_count_ == commands_.size()) {  // more than 10 ms of them: the oldest is due
    first_command_ = (first_command_ + 1) % commands_.size();
    --command_count_;
  }
  commands_[(first_command_ + command_count_) % commands_.size()] = {t_ + model_.body->delay,
                                                                     wrench};
  ++command_count_;
}

}  // namespace palpate
