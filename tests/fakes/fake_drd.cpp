// SPDX-License-Identifier: Apache-2.0
// Force Dimension's SDK with arms that nobody sees: omega.3 of serial numbers 10517, 10518, ...
// With an active wrist they are sigma.7, whose torque stays until another is set. Axes: x towards
// the user, y to the right, z up; metres, newtons. FAKE_DHD leaves out what libdrd has beyond
// libdhd; FAKE_OLD leaves out the watchdog.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "tests/fakes/workbench.hpp"

namespace {

using palpate::test::clock_now;
using palpate::test::find_workbench;
using palpate::test::Workbench;
using palpate::test::workbench;

constexpr double time_guard = 250e-6;  // [s]
enum Cause : int { none = 0, velocity = 2, watchdog = 3, software = 4 };

struct Arm {
  bool is_open = false;
  bool expert = false;
  int cause = none;
  double last_read = 0.0;         // [s]
  std::array<double, 3> place{};  // [m] at that time
};
std::array<Arm, 4> arms;
const char* last_error = "no error";

int fail(const char* error) {
  last_error = error;
  return -1;
}

// The arm, if it can be spoken to.
Arm* arm_of(char id) {
  const auto i = static_cast<std::size_t>(id);
  if (id < 0 || i >= arms.size() || !arms[i].is_open) {
    fail("device not available");
    return nullptr;
  }
  if (!workbench().plugged_in) {
    fail("communication error");
    return nullptr;
  }
  return &arms[i];
}

int count() { return workbench().plugged_in ? workbench().devices.load() : 0; }

// What the firmware does by itself.
void let_firmware_act(Arm& arm) {
  Workbench& bench = workbench();
  if (bench.too_fast.exchange(false)) {
    bench.force_on = false;
    arm.cause = velocity;
  }
  if (bench.force_on && bench.watchdog > 0.0 && clock_now() - bench.commanded > bench.watchdog) {
    bench.force_on = false;
    arm.cause = watchdog;
  }
}

}  // namespace

#define EXPORT extern "C" __attribute__((visibility("default")))

EXPORT int dhdGetDeviceCount() {
  if (std::none_of(arms.begin(), arms.end(), [](const Arm& arm) { return arm.is_open; }))
    find_workbench();
  return count();
}
EXPORT int dhdOpenID(char index) {
  find_workbench();
  if (index < 0 || index >= count()) return fail("no device found");
  Arm& arm = arms[static_cast<std::size_t>(index)];
  arm = Arm{};
  arm.is_open = true;
  ++workbench().opens;
  return index;
}
EXPORT int dhdOpen() { return dhdOpenID(0); }
EXPORT int dhdOpenSerial(int serial) {
  return serial < 10517 ? fail("no device found") : dhdOpenID(static_cast<char>(serial - 10517));
}
EXPORT int dhdClose(char id) {
  const auto i = static_cast<std::size_t>(id);
  if (id < 0 || i >= arms.size() || !arms[i].is_open) return fail("device not available");
  arms[i].is_open = false;
  workbench().force_on = false;
  ++workbench().closes;
  return 0;
}
EXPORT int dhdStop(char id) {
  if (arm_of(id) == nullptr) return -1;
  workbench().force_on = false;
  return 0;
}
EXPORT int dhdGetSystemType(char id) {
  return arm_of(id) == nullptr ? -1 : workbench().active_wrist ? 104 : 33;
}
EXPORT const char* dhdGetSystemName(char id) {
  if (arm_of(id) == nullptr) return nullptr;
  return workbench().active_wrist ? "sigma.7" : "omega.3";
}
EXPORT int dhdGetSerialNumber(unsigned short* number, char id) {
  if (arm_of(id) == nullptr) return -1;
  *number = static_cast<unsigned short>(10517 + id);
  return 0;
}
EXPORT void dhdGetSDKVersion(int* major, int* minor, int* release, int* revision) {
  *major = 3;
  *minor = 17;
  *release = 5;
  *revision = 0;
}
EXPORT const char* dhdErrorGetLastStr() { return last_error; }
EXPORT int dhdGetPosition(double* x, double* y, double* z, char id) {
  Arm* arm = arm_of(id);
  if (arm == nullptr) return -1;
  let_firmware_act(*arm);
  const double now = clock_now();
  const bool guarded = now - arm->last_read < time_guard;
  if (!guarded) {
    const auto [right, away, up] = workbench().hand(now);
    arm->place = {-away, right, up};
    arm->last_read = now;
  }
  *x = arm->place[0];
  *y = arm->place[1];
  *z = arm->place[2];
  return guarded ? 1 : 0;
}
EXPORT int dhdGetOrientationFrame(double rows[3][3], char id) {
  if (arm_of(id) == nullptr) return -1;
  for (int i = 0; i < 9; ++i) rows[i / 3][i % 3] = i % 4 == 0 ? 1.0 : 0.0;
  return 0;
}
EXPORT int dhdSetForce(double x, double y, double z, char id) {
  Arm* arm = arm_of(id);
  if (arm == nullptr) return -1;
  let_firmware_act(*arm);
  workbench().command(x, y, z, clock_now());
  return std::hypot(x, y, z) > 0.5 ? 2 : 0;  // motors saturated: no error
}
EXPORT int dhdSetForceAndTorque(double x, double y, double z, double about_x, double about_y,
                                double about_z, char id) {
  const int result = dhdSetForce(x, y, z, id);
  if (result < 0 || !workbench().active_wrist) return -1;
  const double most = workbench().max_torque;
  const double size = std::hypot(about_x, about_y, about_z);
  const double share = most >= 0.0 && size > most ? most / size : 1.0;
  workbench().torque[0] = share * about_x;
  workbench().torque[1] = share * about_y;
  workbench().torque[2] = share * about_z;
  return result;
}
EXPORT int dhdSetMaxTorque(double newton_metres, char id) {
  if (arm_of(id) == nullptr) return -1;
  workbench().max_torque = newton_metres;
  return 0;
}
EXPORT int dhdEnableForce(unsigned char on, char id) {
  Arm* arm = arm_of(id);
  if (arm == nullptr) return -1;
  workbench().commanded = clock_now();
  workbench().force_on = on != 0;
  arm->cause = on != 0 ? none : software;
  return 0;
}
EXPORT int dhdSetBrakes(int /*on*/, char id) { return arm_of(id) == nullptr ? -1 : 0; }
EXPORT int dhdSetGravityCompensation(int /*on*/, char id) { return arm_of(id) == nullptr ? -1 : 0; }
EXPORT int dhdSetMaxForce(double /*newtons*/, char id) { return arm_of(id) == nullptr ? -1 : 0; }
EXPORT unsigned dhdGetButtonMask(char id) { return arm_of(id) == nullptr ? 0U : 1U; }
EXPORT int dhdEmulateButton(unsigned char /*on*/, char id) {
  return arm_of(id) == nullptr ? -1 : 0;
}
EXPORT int dhdGetStatus(int* status, char id) {
  Arm* arm = arm_of(id);
  if (arm == nullptr) return -1;
  let_firmware_act(*arm);
  std::memset(status, 0, 17 * sizeof(int));
  status[0] = status[1] = status[2] = 1;
  status[3] = workbench().calibrated ? 1 : 0;
  status[5] = workbench().force_on ? 1 : 0;
  status[14] = arm->cause;
  return 0;
}
EXPORT bool dhdHasWrist(char id) { return arm_of(id) == nullptr || workbench().active_wrist; }
EXPORT bool dhdHasActiveWrist(char id) {
  return arm_of(id) != nullptr && workbench().active_wrist && !workbench().wrist_is_off;
}
EXPORT bool dhdHasGripper(char /*id*/) { return false; }
EXPORT int dhdEnableExpertMode() {
  for (Arm& arm : arms) arm.expert = true;
  return 0;
}
#ifndef FAKE_OLD
EXPORT int dhdSetWatchdog(unsigned char units, char id) {
  Arm* arm = arm_of(id);
  if (arm == nullptr) return -1;
  if (!arm->expert) return fail("expert mode disabled");
  workbench().watchdog = 125e-6 * units;
  return 0;
}
#endif
#ifndef FAKE_DHD
EXPORT int drdOpenID(char index) {
  return arm_of(index) == nullptr ? -1 : index;  // one that is open: its own
}
EXPORT bool drdIsInitialized(char id) { return arm_of(id) != nullptr && workbench().calibrated; }
EXPORT int drdAutoInit(char id) {
  if (arm_of(id) == nullptr) return -1;
  ++workbench().calibrations;
  workbench().calibrated = true;
  return 0;
}
EXPORT int drdStop(bool force_on, char id) {
  if (arm_of(id) == nullptr) return -1;
  workbench().force_on = force_on;
  workbench().commanded = clock_now();
  return 0;
}
#endif
