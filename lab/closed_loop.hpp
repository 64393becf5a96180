// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "lab/play.hpp"
#include "palpate/io/devices/device_body.hpp"
#include "palpate/io/devices/hip_path.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate {
class SimulatedHand;
}

namespace palpate::lab {

/// A device in somebody's hand.
struct HeldDevice {
  std::unique_ptr<Device> device;
  /// [N] the motors give no more; infinite on a path, which no force moves
  double peak_force = 0.0;
  std::function<double()> speed;  ///< [m/s] of the handle now; 0 on a path
};

/// A hand that follows a path [m, world] exactly, whatever the force: the open loop.
HeldDevice on_path(const HipPath& path);

/// A simulated hand that wants to follow a path and yields to the force.
/// @param seed  of its tremor
std::unique_ptr<SimulatedHand> simulated_hand(const HipPath& path, const Grip& grip,
                                              const DevicePreset& device, std::uint64_t seed);
/// The same as it is held.
HeldDevice in_hand(const HipPath& path, const Grip& grip, const DevicePreset& device,
                   std::uint64_t seed);

/// A hand that follows a path exactly and releases the handle at the first tick after `from` [s]
/// whose force the device's friction holds: from then on the handle is free, and at rest at first.
HeldDevice let_go(const HipPath& path, const DevicePreset& device, double from);

/// A tick as the hand has it.
struct Felt {
  double t = 0.0;                 ///< [s]
  Vec3 hip = Vec3::Zero();        ///< [m] world, as the device reads it
  Vec3 force = Vec3::Zero();      ///< [N] world, that the device is told to give
  Vec3 asked = Vec3::Zero();      ///< [N] world, that the method asks for
  double surface_velocity = 0.0;  ///< [m/s] as the method has it
  double speed = 0.0;             ///< [m/s] of the handle
  std::uint32_t safety = 0;       ///< SafetyFlag bits; 0 without a chain
};

/// The loop of a method and a held device, at the rate of the scenario's ticks.
class TouchLoop {
 public:
  virtual ~TouchLoop() = default;
  /// A frame arrives, and lives until the next. @param stamp  [s] of its capture @param t  [s] now
  virtual void frame(const std::shared_ptr<const Cloud>& cloud, double stamp, double t) = 0;
  virtual Felt tick(double t) = 0;
};

/// Device, method, device: the method's force alone, cut to the motors' peak.
std::unique_ptr<TouchLoop> straight_loop(std::unique_ptr<Method> method, HeldDevice held);

/// The cycle of a live session with its safety chain between method and device. The motors are
/// cold at the start.
std::unique_ptr<TouchLoop> safe_loop(std::unique_ptr<Method> method, HeldDevice held,
                                     const Parameters& parameters, SafetyParameters safety = {});

/// Plays one camera to several loops, which have the same frames at the same ticks. The scenario's
/// `hip` is not used.
/// @param on_tick  called after each loop's tick, with the loop's place in the list
void play_to(const std::vector<std::unique_ptr<TouchLoop>>& loops, const Scenario& scenario,
             const std::function<void(std::size_t loop, const Felt&)>& on_tick);

}  // namespace palpate::lab
