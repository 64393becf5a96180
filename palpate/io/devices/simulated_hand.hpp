// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "palpate/io/devices/device_body.hpp"
#include "palpate/io/devices/hip_path.hpp"
#include "palpate/servo/device.hpp"

namespace palpate {

/// A person's arm on the handle, as a spring and damper that pull a mass after where they want it.
struct HandModel {
  double mass = 0.15;           ///< [kg] of hand and handle; with a body, of the hand alone
  double stiffness = 300.0;     ///< [N/m] of the grip towards the target
  double damping = 8.0;         ///< [N s/m]
  double tremor = 0.1e-3;       ///< [m] largest deviation of the target, 8 to 12 Hz
  double turn_stiffness = 0.2;  ///< [N m/rad] of the grip towards the path's orientation
  double turn_damping = 2e-3;   ///< [N m s/rad] both only with a body that turns
  std::uint64_t seed = 1;       ///< of the tremor's phases
  /// The device that is held; none: an ideal handle without friction, delay or resolution.
  std::optional<DeviceBody> body = {};
};

/// How stable it was to touch. The hand's thread writes, any may look.
struct HandStatistics {
  std::atomic<double> work{0.0};        ///< [J] that the force has done on the hand so far
  std::atomic<double> most_work{0.0};   ///< [J] the largest that `work` has been
  std::atomic<double> shake{0.0};       ///< [m] rms of its motion above 20 Hz, in the last 0.25 s
  std::atomic<double> most_shake{0.0};  ///< [m] the largest that `shake` has been
  std::atomic<double> top_speed{0.0};   ///< [m/s]
  // Of a hand with a body:
  std::atomic<double> friction_loss{0.0};  ///< [J] lost in the device's Coulomb friction so far
  std::atomic<double> damping_loss{0.0};   ///< [J] lost in the device's viscous damping so far
  std::atomic<double> kinetic{0.0};        ///< [J] kinetic energy of hand and device
  std::atomic<double> turn_rate{0.0};      ///< [rad/s] of a handle that turns
};

/// A simulated person who follows a path and yields to the force: what closes the loop in tests.
///
/// m x'' = F + k (x_target - x) + b (x_target' - x'), semi-implicit, in steps of at most 0.1 ms,
/// with the force held from one write to the next. Deterministic.
///
/// With a body of a device: (m + m_d) x'' = F + k (x_target - x) + b (x_target' - x') - b_d x'
/// - f_c x' / |x'|, by the exact solution in steps of at most 0.1 ms; it sticks where the other
/// forces are at most f_c. The force comes after the device's delay, and the position is read in
/// steps of its resolution. Where the body has an inertia I, the handle turns as well:
/// I w' = T + k_t r + b_t (w_target - w) - b_td w, with the rotation vector r to the path's
/// orientation, semi-implicit. Without, it is turned as the path is, if that says how.
class SimulatedHand final : public Device {
 public:
  /// @param target  [m] device frame; begins at the first `read`, at rest in its first place
  /// @throws Error if mass is not in 0.01 to 10 kg, stiffness in 1 to 10^4 N/m, damping in 0 to
  ///         10^3 N s/m or tremor in 0 to 10 mm; with a body, mass and stiffness may be 0.
  SimulatedHand(HipPath target, const HandModel& model, std::string uri = "hand:");

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  [[nodiscard]] const HandModel& model() const { return model_; }
  /// Lets the time since the last read pass, at most 0.1 s of it. [servo]
  HandState read(double t) noexcept override;
  void write(const Vec3& force, double t) noexcept override { write(Wrench{.force = force}, t); }
  void write(const Wrench& wrench, double t) noexcept override;
  void enable() override { enabled_.store(true, std::memory_order_relaxed); }
  void disable() noexcept override { enabled_.store(false, std::memory_order_relaxed); }

  /// Gives the handle a velocity [m/s] and takes it to a place [m], before the first `read`.
  void launch(const Vec3& position, const Vec3& velocity) noexcept;

  /// What its device says of itself, instead of a hand without motors; before it is used.
  void set_device(const DevicePreset& preset);

  [[nodiscard]] const HandStatistics& statistics() const { return statistics_; }

 private:
  [[nodiscard]] Vec3 target(double t) const noexcept;
  void step(double dt) noexcept;
  void step_body(double dt) noexcept;
  void slide(double dt, const Vec3& target_velocity) noexcept;
  void turn(double dt) noexcept;
  [[nodiscard]] bool turns() const noexcept { return model_.body && model_.body->inertia > 0.0; }
  void keep_shake(double dt) noexcept;
  void take_due_force() noexcept;

  DeviceInfo info_;
  HipPath path_;
  HandModel model_;
  std::array<Vec3, 3> phases_;  // [rad] of the tremor's three tones

  bool began_ = false;
  double began_at_ = 0.0;  // [s] on the loop's clock
  double t_ = 0.0;         // [s] since then
  Vec3 position_ = Vec3::Zero();
  Vec3 velocity_ = Vec3::Zero();
  Vec3 target_ = Vec3::Zero();
  Vec3 force_ = Vec3::Zero();
  Vec3 torque_ = Vec3::Zero();
  Rotation orientation_, target_orientation_;  // device_from_handle
  Vec3 turn_rate_ = Vec3::Zero();              // [rad/s]
  Vec3 slow_ = Vec3::Zero();                   // the motion below 20 Hz, twice filtered
  Vec3 slower_ = Vec3::Zero();
  double squared_shake_ = 0.0;
  double work_ = 0.0;
  HandStatistics statistics_;
  std::atomic<bool> enabled_{true};

  // Of a hand with a body.
  struct Command {
    double due = 0.0;  // [s] when the motors give it
    Wrench wrench;
  };
  std::array<Command, 128> commands_{};  // a ring: 10 ms of delay at 10 kHz
  std::size_t first_command_ = 0;
  std::size_t command_count_ = 0;
  MassSpringDamper system_{};
  ExactStep exact_step_;
  double exact_dt_ = 0.0;  // [s] of exact_step_
  double friction_loss_ = 0.0;
  double damping_loss_ = 0.0;
};

}  // namespace palpate
