// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "palpate/drivers/reopener.hpp"
#include "palpate/kernel/core/patch.hpp"
#include "palpate/servo/device.hpp"
#include "palpate/servo/mailbox.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {

/// A hand behind a channel on which other threads speak: the servo takes the newest state and
/// leaves its newest force, and never waits.
class ChannelHand : public Device {
 public:
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }

  HandState read(double /*t*/) noexcept override {
    if (const Seen* seen = seen_.take()) last_ = *seen;
    HandState state = last_.state;
    if (monotonic_now() - last_.time > silence_) state.fault = DeviceFault::disconnected;
    state.present = state.fault == DeviceFault::none;
    return state;
  }
  void write(const Vec3& force, double /*t*/) noexcept override {
    const bool passes = enabled_.load(std::memory_order_acquire) && force.allFinite();
    forces_.put(passes ? force : Vec3::Zero());
    word_.call();
  }
  void enable() override { enabled_.store(true, std::memory_order_release); }
  void disable() noexcept override {
    enabled_.store(false, std::memory_order_release);
    word_.call();
  }

 protected:
  struct Seen {
    HandState state{.present = false, .fault = DeviceFault::disconnected};
    double time = 0.0;  // [s]
  };
  static constexpr double beat_time = 0.020;  // [s] without a force from the servo: none is sent

  /// @param silence  [s] a state that is older does not count
  explicit ChannelHand(double silence) : silence_(silence) {}

  /// The speaking thread ends its loop at this.
  void begin_end() noexcept {
    ending_.store(true, std::memory_order_release);
    word_.call();
  }
  [[nodiscard]] bool is_ending() const noexcept { return ending_.load(std::memory_order_acquire); }

  /// The servo's force, no longer than `most` [N]; none where it did not write for `beat_time`, or
  /// the device is disabled. The speaking thread's.
  Vec3 newest_force(double most) {
    const double now = monotonic_now();
    if (forces_.take() != nullptr) written_ = now;
    const bool passes = enabled_.load(std::memory_order_acquire) && now - written_ <= beat_time;
    return passes ? no_longer_than(forces_.taken_last(), most) : Vec3(Vec3::Zero());
  }

  DeviceInfo info_;     // set before the constructor returns
  Mailbox<Seen> seen_;  // to the servo
  WakeUp word_;         // the servo has written, or all ends

 private:
  std::atomic<bool> enabled_{false}, ending_{false};
  Mailbox<Vec3> forces_;  // [N] from the servo
  double silence_;
  double written_ = 0.0;  // [s] when the servo last wrote
  Seen last_;             // of the servo's thread
};

}  // namespace palpate
