// SPDX-License-Identifier: Apache-2.0
#include <string>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/force_watchdog.hpp"

namespace palpate {
namespace test_force_watchdog {

struct SwitchedDevice final : Device {
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override { return {}; }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}
  void enable() override {
    if (refuses) throw Error("switched:", "it refuses", "leave it");
    enabled = true;
  }
  void disable() noexcept override {
    enabled = false;
    ++disables;
  }

  int disables = 0;
  bool enabled = true;
  bool refuses = false;

 private:
  DeviceInfo info_{.uri = "switched:", .kind = "switched", .limits = {}};
};

// Hazard: hang
TEST(ForceWatchdog, TakesAForceOffAfter10msWithoutATick) {
  SwitchedDevice device;
  ForceWatchdog watchdog(device);
  watchdog.beat(5.0, true);
  watchdog.look(5.0099);
  EXPECT_TRUE(device.enabled);
  watchdog.look(5.0101);
  EXPECT_FALSE(device.enabled);
  EXPECT_EQ(device.disables, 1);
  watchdog.look(5.02);
  EXPECT_EQ(device.disables, 1) << "once";
  EXPECT_NEAR(watchdog.silence(5.02), 0.02, 1e-12);
}

// Hazard: hang
TEST(ForceWatchdog, GivesALoopWithoutAForce25ms) {
  SwitchedDevice device;
  ForceWatchdog watchdog(device);
  watchdog.beat(5.0, false);
  watchdog.look(5.0249);
  EXPECT_TRUE(device.enabled);
  watchdog.look(5.0251);
  EXPECT_FALSE(device.enabled);
}

// Hazard: hang
TEST(ForceWatchdog, JudgesByTheForceOfTheLastTickAlone) {
  SwitchedDevice device;
  ForceWatchdog watchdog(device);
  watchdog.beat(5.0, true);
  watchdog.beat(5.001, false);
  watchdog.look(5.02);
  EXPECT_TRUE(device.enabled);
}

// Hazard: hang
TEST(ForceWatchdog, EnablesTheDeviceWhenTicksComeAgainAndNotBefore) {
  SwitchedDevice device;
  ForceWatchdog watchdog(device);
  watchdog.beat(5.0, true);
  watchdog.look(5.1);
  watchdog.look(6.0);
  EXPECT_FALSE(device.enabled);
  watchdog.beat(6.001, false);
  watchdog.look(6.002);
  EXPECT_TRUE(device.enabled);
}

// Hazard: hang
TEST(ForceWatchdog, AsksADeviceThatRefusesOnceASecondAndSaysWhy) {
  SwitchedDevice device;
  ForceWatchdog watchdog(device);
  watchdog.beat(5.0, true);
  watchdog.look(5.1);
  device.refuses = true;
  watchdog.beat(6.0, false);
  watchdog.look(6.0);
  EXPECT_EQ(watchdog.refusal(), "switched:: it refuses; leave it");
  device.refuses = false;
  watchdog.beat(6.99, false);
  watchdog.look(6.99);
  EXPECT_FALSE(device.enabled);
  watchdog.beat(7.01, false);
  watchdog.look(7.01);
  EXPECT_TRUE(device.enabled);
  EXPECT_EQ(watchdog.refusal(), "");
}

}  // namespace test_force_watchdog
}  // namespace palpate
