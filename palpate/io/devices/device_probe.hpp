// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "palpate/kernel/core/patch.hpp"
#include "palpate/servo/device.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {

/// A tick as it moved a handle that nobody holds.
struct HandleSample {
  double t;       ///< [s] of the read, and of the write that follows
  Vec3 position;  ///< [m] device, as read
  Vec3 force;     ///< [N] device, as written
};

/// A measured figure with its uncertainty.
struct Measured {
  double value = 0.0;
  double error = 0.0;  ///< two standard deviations, by what the fit leaves over
};

/// What moves along one axis of a device.
struct AxisFit {
  Measured mass;        ///< [kg] apparent mass at the handle
  Measured damping;     ///< [N s/m] viscous
  Measured friction;    ///< [N] Coulomb
  Measured load;        ///< [N] constant force along the axis that acts on the handle: its weight
  Measured spring;      ///< [N/m] of whatever holds the handle; about 0 where nobody does
  int swings = 0;       ///< movements that the fit is made from
  double misfit = 0.0;  ///< [-] of the force, the share that the model does not explain, rms
};

/// The mechanics of a device by its own motors.
struct HandleFit {
  std::array<std::optional<AxisFit>, 3> axes;  ///< empty where it hardly moved
  std::optional<Measured> delay;               ///< [s] from a write until the motors give the force
};

/// Fits m x'' = F(t - t_d) - b x' - f sign(x') + g to movements along the axes, by weighted
/// integrals over each (the weak form), so that positions are never differentiated. Only stretches
/// count in which the handle goes 2 mm or more one way along one axis. The delay is what leaves the
/// least over, from 0 to 10 ms, common to all axes. Allocates. Not for a tick.
HandleFit fit_handle(std::span<const HandleSample> samples);

/// How a device is measured.
struct ProbeOptions {
  double rate = 1000.0;           ///< [Hz] of the ticks, where the device has no rate of its own
  double force = 0.45;            ///< [N] largest, up to 0.45
  double travel = 0.03;           ///< [m] from where the handle was: farther ends it; 0.005 to 0.1
  double top_speed = 0.5;         ///< [m/s] faster ends it
  double time = 60.0;             ///< [s] longest
  RealtimeRequest realtime = {};  ///< of a device that is not simulated
  std::function<bool()> cancelled = {};  ///< asked every 10 ms; true ends it
};

/// What a device's own motors found out about it.
struct DeviceMeasurement {
  std::string ended;  ///< why it ended before all was measured; empty if all was
  HandleFit fit;
  Vec3 start = Vec3::Zero();               ///< [m] device: where the handle was
  std::optional<double> noise = {};        ///< [m] rms of the position at rest, of the worst axis
  double rest_drift = 0.0;                 ///< [m] that the handle moved without a force, before
  std::optional<double> resolution = {};   ///< [m] smallest change of the position
  std::optional<double> update_rate = {};  ///< [Hz] at which the position is new
  double tick_rate = 0.0;                  ///< [Hz] of the ticks as they were
  double largest_force = 0.0;              ///< [N] that was sent
  double farthest = 0.0;                   ///< [m] that the handle was moved from `start`
  int stalls = 0;                   ///< times that the loop or the measuring thread stood still
  double longest_stall = 0.0;       ///< [s]
  std::vector<std::string> doubts;  ///< why the figures may be wrong, a sentence each
};

/// Moves a handle that nobody holds, back and forth along each axis, by at most `force`, and fits
/// its mechanics. Through the servo loop and its safety chain: the force is off at once, and stays
/// off, when the handle goes too far or too fast, when the device reports a fault or no hand, when
/// `cancelled` says so, and when this thread or the loop hangs (ServoLoop; frames that it no longer
/// gets). A simulated device is measured on a clock of its own, at once.
///
/// What a computer that was too busy has ended or spoiled is told from what the device did:
/// `ended`, `doubts` and the error say so.
///
/// Takes some 10 to 40 s. Ask the person beside the device first.
/// @throws Error if the options are out of range, or the device has no motors, cannot be started or
///         does not become ready within 5 s.
DeviceMeasurement measure_device(Device& device, const ProbeOptions& options = {});

/// The settings that a measurement proposes for a session on the device.
struct DeviceProposal {
  double rate = 1000.0;    ///< [Hz] of the ticks
  double undamped = 0.0;   ///< [N/m] stiffness without a damper
  double damping = 0.0;    ///< [N s/m] k_d
  double stiffness = 0.0;  ///< [N/m] with that
  /// [N] device: the constant force on the handle, its weight, where the device lets it be felt
  std::optional<Vec3> load = {};
};

/// Recommended stiffness: 80 % of the largest stiffness at which the linear model of the released
/// handle (SampledWall) is stable, for the axis with the least damping, with delay and damping at
/// the unfavourable end of their uncertainty and the mass as measured, and at most the rated
/// stiffness. Coulomb friction is ignored and adds a margin. Empty if mass, damping or delay is too
/// uncertain.
std::optional<DeviceProposal> propose(const DeviceInfo& device,
                                      const DeviceMeasurement& measurement);

}  // namespace palpate
