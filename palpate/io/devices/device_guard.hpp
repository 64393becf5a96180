// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "palpate/servo/device.hpp"

namespace palpate {

/// How a guard watches the session's process.
struct GuardLimits {
  double beat_time = 0.020;  ///< [s] without a `write` of the session: zero force; 0.005 to 0.05
  double period = 0.001;     ///< [s] between two reads of the device; 1e-4 to 0.01
};

/// Decides which force a guard passes on. Follows from the times that it is given alone.
class GuardGate {
 public:
  explicit GuardGate(double beat_time) : beat_time_(beat_time) {}

  /// @param now     [s]
  /// @param beats   how many wrenches the session has written so far
  /// @param wrench  device frame: the newest of them
  /// @return zero if none came for beat_time, and from then on until the session has written zero:
  ///         a process that was stopped may continue in the middle of a tick.
  Wrench pass(double now, std::uint64_t beats, const Wrench& wrench);

  /// Is the session's force kept from the device?
  [[nodiscard]] bool closed() const { return closed_; }

 private:
  double beat_time_;
  std::uint64_t beats_ = 0;
  double last_beat_ = 0.0;  // [s]
  bool closed_ = true;      // until the first zero force
};

/// Runs the device in a separate guard process, which sets the force to zero when the session
/// process dies, is stopped or hangs. No failure of the session process keeps a force on the device
/// for longer than `GuardLimits::beat_time` plus one period. A failure of the whole computer is not
/// covered.
///
/// The guard is forked here, opens the device, reads it once a period (a device that `drives()`: in
/// its driver's callback) and writes what the session wrote last. The result is polled. The
/// session's data is one period older than without a guard. After the guard has set a force to zero
/// the device reports a fault until the session has written a zero force. The guard ignores the
/// signals that end a session, and ends by itself when its parent has ended.
///
/// The result's `DeviceInfo::watchdog` is `beat_time`, or the device's own if that is shorter. If
/// the guard itself dies, the result reports `DeviceFault::disconnected`, and the device's driver
/// has closed the device, or its own watchdog counts.
///
/// @param open  opens the device, in the guard's process. Call this while the process has one
///              thread: others are not there in the guard, with whatever lock they hold.
/// @throws Error if the process cannot be made or the device cannot be opened: what `open` said.
std::unique_ptr<Device> open_guarded(const std::function<std::unique_ptr<Device>()>& open,
                                     const GuardLimits& limits = {});

}  // namespace palpate
