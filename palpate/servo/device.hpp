// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Geometry>

#include "palpate/kernel/core/hand.hpp"

struct palpate_gate_wish;  // last_gate.h

namespace palpate {

/// What a device's motors and its closed loop are good for. Defaults: a Touch-class desktop arm.
struct DeviceLimits {
  double max_force = 3.3;                    ///< [N] peak, for moments
  double continuous_force = 0.88;            ///< [N] continuous (thermal) force rating
  std::optional<double> max_stiffness = {};  ///< [N/m] nominal: a stiffer wall may oscillate
  std::optional<double> max_damping = {};    ///< [N s/m] nominal
  bool motors = true;                        ///< false: no force that is sent reaches a hand
  double max_torque = 0.0;                   ///< [N m] peak; 0: none is sent
};

/// Limits of a hand without motors: the peak force of a Touch, continuously.
constexpr DeviceLimits no_motors{.max_force = 3.3, .continuous_force = 3.3, .motors = false};

/// Where a device can reach, in its own frame: a box, or a ball about the origin.
struct DeviceReach {
  Vec3 lowest;   ///< [m] device: corner of the box; of a ball -radius on each axis
  Vec3 highest;  ///< [m] device: the opposite corner
  std::optional<double> radius = {};  ///< [m] set for a ball

  static DeviceReach ball(double radius_m) {
    return {Vec3::Constant(-radius_m), Vec3::Constant(radius_m), radius_m};
  }
};

/// What is known of an open device. What a driver does not know is left empty.
struct DeviceInfo {
  std::string uri;   ///< as it was opened
  std::string kind;  ///< e.g. "scripted path"
  DeviceLimits limits;
  std::optional<DeviceReach> reach = {};
  std::optional<double> damping = {};  ///< [N s/m] of the mechanism
  std::optional<double> delay = {};    ///< [s] from a write to the motors' force
  std::optional<double> rate = {};     ///< [Hz] at which the device is updated
  /// [s] the hardware takes its force away when no command came for this long; empty: never. A
  /// session in real time refuses forces on a device with motors without one; see SessionOptions.
  std::optional<double> watchdog = {};
  bool simulated = false;   ///< a simulated hand: it may be read on any clock
  std::string serial = {};  ///< serial number, empty if unknown
};

/// Why a device gives no force; `none` if it does.
enum class DeviceFault : std::uint8_t {
  none,
  not_calibrated,   ///< its position cannot be trusted until it has been calibrated
  disconnected,     ///< the cable, the power or the driver is gone
  overheated,       ///< its motors must cool down
  emergency_stop,   ///< its emergency stop or dead man's switch is open
  busy,             ///< another program holds it
  refused_command,  ///< it did not accept a force
  other,            ///< see Device::fault_text
  another_hand,     ///< another hand of the session is in trouble; see Cycle::link
};

/// As in the code, e.g. "not_calibrated".
std::string_view to_string(DeviceFault fault);
/// The fault and its remedy in a sentence; empty for `none`.
std::string_view describe(DeviceFault fault);

/// The state of the device's handle at one read, in the device's own frame.
struct HandState {
  Vec3 position = Vec3::Zero();                        ///< [m] device
  std::optional<Eigen::Quaterniond> orientation = {};  ///< device_from_handle, length 1
  std::optional<std::uint32_t> buttons = {};           ///< bit i: button i is pressed
  bool present = true;    ///< false: nobody holds it, or it cannot be read; no force then
  bool clutched = false;  ///< true: the hand moves and the HIP stays; no force then
  DeviceFault fault = DeviceFault::none;  ///< other than `none`: no force
};

/// Runs one cycle of the loop on the calling thread; the cycle calls `read` and `write`. [servo]
using CycleCallback = std::function<void()>;

/// A haptic device. The constructor opens it, the destructor closes it with its motors off.
///
/// There are two kinds. A device that is polled is read and written by the loop's own thread. A
/// device whose driver owns a periodic callback (`drives()`) calls the cycle from there.
///
/// The cycle calls `read` and `write` in turn, once each, from one thread. Neither may wait for
/// longer than the device's own cycle, allocate, or throw: a device that cannot be read reports
/// `present = false` and the fault.
class Device {
 public:
  Device() = default;
  virtual ~Device() = default;
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  [[nodiscard]] virtual const DeviceInfo& info() const = 0;
  /// [servo] @param t  [s] now, on the loop's clock
  virtual HandState read(double t) noexcept = 0;
  /// [servo] @param force  [N] device frame, on the hand  @param t  as for `read`
  virtual void write(const Vec3& force, double t) noexcept = 0;
  /// [servo] The same with a torque, which a device of three motors leaves out. The cycle calls
  /// this one.
  virtual void write(const Wrench& wrench, double t) noexcept { write(wrench.force, t); }

  /// [servo] What the `write` that follows was judged by: a device in another process judges it
  /// there once more (see open_guarded). Others need not know.
  virtual void announce(const palpate_gate_wish& /*wish*/) noexcept {}

  /// Switches the motors on, with zero force. Any thread but the servo's; may wait.
  /// A device with motors overrides this and `disable`; the default is for one without.
  /// @throws Error if the device refuses, with the remedy.
  virtual void enable() {}
  /// Takes the force away at once and ignores `write` until `enable`. Any thread, at any time,
  /// also while a read or write is in progress or hangs; any number of times; never waits.
  virtual void disable() noexcept {}

  /// The present fault in a sentence with its remedy, or empty; may say more than
  /// describe(fault). Any thread but the servo's.
  [[nodiscard]] virtual std::string fault_text() const { return {}; }

  /// True if the driver's own thread calls the cycle, between `start` and `stop`.
  [[nodiscard]] virtual bool drives() const { return false; }
  /// Begins to call `cycle` on the driver's thread, once per update. Only if `drives()`.
  /// @throws Error if the driver cannot start its callback.
  virtual void start(CycleCallback /*cycle*/) {}
  /// Ends the callbacks; when it returns none is running and none will come. Only if `drives()`.
  virtual void stop() noexcept {}
};

}  // namespace palpate
