// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "palpate/kernel/core/uri.hpp"
#include "palpate/servo/device.hpp"
#include "palpate/servo/mailbox.hpp"

namespace palpate {

/// How sticks or a puck stand.
struct StickState {
  /// [-] -1 to 1 along each axis: to the right, away from the user, up
  Vec3 deflection = Vec3::Zero();
  std::uint32_t buttons = 0;
  bool plugged_in = true;
};

/// Something with sticks. Used by one thread.
class Sticks {
 public:
  virtual ~Sticks() = default;
  /// Waits for up to some 20 ms. @return how it stands then
  virtual StickState wait() noexcept = 0;
  /// Lets the user feel a contact. @param share  [-] of the largest force, 0: none
  /// @param begins  the contact has just begun
  virtual void feel(double /*share*/, bool /*begins*/) noexcept {}
};

/// How a rate hand moves.
struct RateOptions {
  Vec3 start = Vec3(0.0, 0.0, 0.05);  ///< [m] device frame
  double speed = 0.1;                 ///< [m/s] at full deflection, 0.01 to 1
  double dead_zone = 0.08;            ///< [-] of the deflection, 0 to 0.5
};
/// @throws Error for another option of the URI, or a value out of range
inline RateOptions rate_options(const Uri& uri) {
  uri.allow_only(std::to_array<std::string_view>({"x", "y", "z", "speed", "dead_zone"}));
  RateOptions options;
  for (int i = 0; i < 3; ++i)
    options.start[i] =
        uri.number_option(std::string(1, "xyz"[i]), options.start[i], -1e6, 1e6, "m");
  options.speed = uri.number_option("speed", options.speed, 0.01, 1.0, "m/s");
  options.dead_zone = uri.number_option("dead_zone", options.dead_zone, 0.0, 0.5, "1");
  return options;
}

/// A hand without motors, led by sticks: deflection is speed (rate control), growing with its
/// square beyond the dead zone. Sticks are read on a thread of their own.
class RateHand final : public Device {
 public:
  RateHand(std::unique_ptr<Sticks> sticks, DeviceInfo info, const RateOptions& options)
      : sticks_(std::move(sticks)),
        info_(std::move(info)),
        options_(options),
        position_(options.start),
        thread_(&RateHand::run, this) {}
  ~RateHand() override {
    ending_.store(true, std::memory_order_release);
    thread_.join();
  }

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override {
    states_.take();
    const StickState& sticks = states_.taken_last();
    const double dt = last_t_ < 0.0 ? 0.0 : std::clamp(t - last_t_, 0.0, longest_step);
    last_t_ = t;
    Vec3 velocity = Vec3::Zero();
    if (sticks.plugged_in) {
      for (int i = 0; i < 3; ++i)
        velocity[i] = options_.speed * share_of_speed(sticks.deflection[i]);
    }
    position_ += dt * velocity;
    return {.position = position_,
            .buttons = sticks.buttons,
            .present = sticks.plugged_in,
            .fault = sticks.plugged_in ? DeviceFault::none : DeviceFault::disconnected};
  }
  void write(const Vec3& force, double /*t*/) noexcept override {
    force_.store(force.norm(), std::memory_order_relaxed);
  }

 private:
  static constexpr double longest_step = 0.05;  // [s] of motion between two reads
  static constexpr double felt_force = 0.05;    // [N] from which on there is a contact

  // Of a deflection along one axis.
  [[nodiscard]] double share_of_speed(double deflection) const {
    const double dead = options_.dead_zone;
    const double beyond = (std::min(std::abs(deflection), 1.0) - dead) / (1.0 - dead);
    return beyond > 0.0 ? std::copysign(beyond * beyond, deflection) : 0.0;
  }

  void run() {
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

  std::unique_ptr<Sticks> sticks_;
  DeviceInfo info_;
  RateOptions options_;
  Mailbox<StickState> states_;
  std::atomic<double> force_{0.0};  // [N]
  std::atomic<bool> ending_{false};
  // Of the servo's thread:
  Vec3 position_;
  double last_t_ = -1.0;  // [s]
  std::thread thread_;
};

}  // namespace palpate
