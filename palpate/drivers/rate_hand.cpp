// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/rate_hand.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate {
namespace {

constexpr double longest_step = 0.05;  // [s] of motion between two reads
constexpr double felt_force = 0.05;    // [N] from which on there is a contact

// Deflection to share of the speed, along one axis.
double share_of_speed(double deflection, double dead_zone) {
  const double beyond = (std::min(std::abs(deflection), 1.0) - dead_zone) / (1.0 - dead_zone);
  return beyond > 0.0 ? std::copysign(beyond * beyond, deflection) : 0.0;
}

}  // namespace

RateOptions rate_options(const Uri& uri) {
  RateOptions options;
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (int i = 0; i < 3; ++i)
    options.start[i] =
        uri.number_option(axes[static_cast<std::size_t>(i)], options.start[i], -1e6, 1e6, "m");
  options.speed = uri.number_option("speed", options.speed, 0.01, 1.0, "m/s");
  options.dead_zone = uri.number_option("dead_zone", options.dead_zone, 0.0, 0.5, "1");
  return options;
}

RateHand::RateHand(std::unique_ptr<Sticks> sticks, DeviceInfo info, const RateOptions& options)
    : sticks_(std::move(sticks)),
      info_(std::move(info)),
      options_(options),
      position_(options.start),
      thread_(&RateHand::run, this) {}

RateHand::~RateHand() {
  ending_.store(true, std::memory_order_release);
  thread_.join();
}

HandState RateHand::read(double t) noexcept {
  states_.take();
  const StickState& sticks = states_.taken_last();
  const double dt = last_t_ < 0.0 ? 0.0 : std::clamp(t - last_t_, 0.0, longest_step);
  last_t_ = t;
  Vec3 velocity = Vec3::Zero();
  if (sticks.plugged_in) {
    for (int i = 0; i < 3; ++i)
      velocity[i] = options_.speed * share_of_speed(sticks.deflection[i], options_.dead_zone);
  }
  position_ += dt * velocity;
  return {.position = position_,
          .buttons = sticks.buttons,
          .present = sticks.plugged_in,
          .fault = sticks.plugged_in ? DeviceFault::none : DeviceFault::disconnected};
}

void RateHand::write(const Vec3& force, double /*t*/) noexcept {
  force_.store(force.norm(), std::memory_order_relaxed);
}

void RateHand::run() {
  bool in_contact = false;
  while (!ending_.load(std::memory_order_acquire)) {
    states_.put(sticks_->wait());
    const double force = force_.load(std::memory_order_relaxed);
    const bool begins = force > felt_force && !in_contact;
    in_contact = force > felt_force;
    const double share = in_contact ? std::min(force / info_.limits.max_force, 1.0) : 0.0;
    sticks_->feel(share, begins);
  }
  sticks_->feel(0.0, false);
}

}  // namespace palpate
