// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>

#include "palpate/devices/hip_path.hpp"
#include "palpate/servo/device.hpp"

namespace palpate {

/// A person's arm on the handle, as a spring and damper that pull a mass after where they want it.
struct HandModel {
  double mass = 0.15;        ///< [kg] of hand and handle
  double stiffness = 300.0;  ///< [N/m] of the grip towards the target
  double damping = 8.0;      ///< [N s/m]
  double tremor = 0.1e-3;    ///< [m] largest deviation of the target, 8 to 12 Hz
  std::uint64_t seed = 1;    ///< of the tremor's phases
};

/// How stable it was to touch. The hand's thread writes, any may look.
struct HandStatistics {
  std::atomic<double> work{0.0};        ///< [J] that the force has done on the hand so far
  std::atomic<double> most_work{0.0};   ///< [J] the largest that `work` has been
  std::atomic<double> shake{0.0};       ///< [m] rms of its motion above 20 Hz, in the last 0.25 s
  std::atomic<double> most_shake{0.0};  ///< [m] the largest that `shake` has been
  std::atomic<double> top_speed{0.0};   ///< [m/s]
};

/// A simulated person who follows a path and yields to the force: what closes the loop in tests.
///
/// m x'' = F + k (x_target - x) + b (x_target' - x'), semi-implicit, in steps of at most 0.1 ms,
/// with the force held from one write to the next. Deterministic.
class SimulatedHand final : public Device {
 public:
  /// @param target  [m] device frame; begins at the first `read`, at rest in its first place
  /// @throws Error if mass is not in 0.01 to 10 kg, stiffness in 1 to 10^4 N/m, damping in 0 to
  ///         10^3 N s/m or tremor in 0 to 10 mm.
  SimulatedHand(HipPath target, const HandModel& model, std::string uri = "hand:");

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  /// Lets the time since the last read pass, at most 0.1 s of it. [servo]
  HandState read(double t) noexcept override;
  void write(const Vec3& force, double t) noexcept override;

  [[nodiscard]] const HandStatistics& statistics() const { return statistics_; }

 private:
  [[nodiscard]] Vec3 target(double t) const noexcept;
  void step(double dt) noexcept;

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
  Vec3 slow_ = Vec3::Zero();  // the motion below 20 Hz, twice filtered
  Vec3 slower_ = Vec3::Zero();
  double squared_shake_ = 0.0;
  double work_ = 0.0;
  HandStatistics statistics_;
};

}  // namespace palpate
