// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <functional>
#include <memory>

#include <gtest/gtest.h>

#include "tests/drivers/fake_device_test.hpp"
#include "tests/support/comes_true.hpp"

namespace palpate {
namespace test_open_haptics {

class OpenHaptics : public test::FakeDeviceTest {
 protected:
  OpenHaptics() : FakeDeviceTest("touch", "PALPATE_OPENHAPTICS", "openhaptics") {}
  static void wait_until(const std::function<bool()>& done) {
    EXPECT_TRUE(test::comes_true(done)) << "it waited for a minute";
  }
};

TEST_F(OpenHaptics, TellsWhatItIsInOurAxes) {
  const auto pen = open("touch:");
  const DeviceInfo& info = pen->info();
  EXPECT_EQ(info.kind, "Touch by OpenHaptics");
  EXPECT_EQ(info.serial, "20230117");
  EXPECT_EQ(info.limits.max_force, 3.3);
  EXPECT_EQ(info.limits.continuous_force, 0.88);
  EXPECT_EQ(info.limits.max_stiffness, 400.0);
  EXPECT_FALSE(info.watchdog) << "none is documented";
  // The vendor's box is 420 x 315 x 215 mm, y up, z from 85 mm away to 130 mm towards the user.
  EXPECT_NEAR(info.reach->lowest.x(), -0.21, 1e-12);
  EXPECT_NEAR(info.reach->lowest.y(), -0.13, 1e-12);
  EXPECT_NEAR(info.reach->highest.z(), 0.205, 1e-12);
}

TEST_F(OpenHaptics, CallsTheCycleAndSendsNoForceFasterThanItBears) {
  const auto pen = open("touch:?slew=500");
  pen->enable();
  std::atomic<int> ticks{0};
  std::atomic<int> faults{0};
  const Vec3 force(0.0, 0.0, 1.5);  // up
  pen->start([&] {
    const double now = test::clock_now();
    const HandState hand = pen->read(now);
    if (hand.fault != DeviceFault::none) ++faults;
    pen->write(ticks % 40 < 20 ? force : Vec3(-force), now);  // a step that drops the motors
    ++ticks;
  });
  wait_until([&] { return ticks > 200; });
  EXPECT_EQ(faults, 0) << "the driver's limit of a tick is 0.9 N";
  EXPECT_TRUE(bench.force_on);
  EXPECT_NEAR(bench.largest, 1.5, 1e-9);
  EXPECT_EQ(bench.force[0], 0.0);
  EXPECT_EQ(bench.force[2], 0.0);
  pen->stop();
  const int before = ticks;
  pen->write(Vec3::Zero(), test::clock_now());
  EXPECT_EQ(bench.motor_force(test::clock_now()), 0.0) << "also without a read before";
  pen->disable();
  EXPECT_FALSE(bench.force_on);
  EXPECT_EQ(ticks, before) << "no callback after stop";
}

TEST_F(OpenHaptics, GivesNoForceWhileItsMotorsAreHot) {
  const auto pen = open("touch:");
  pen->enable();
  std::atomic<DeviceFault> fault{DeviceFault::none};
  std::atomic<bool> was_hot{false}, let_go{false};  // it lasts shorter than this thread may wait
  pen->start([&] {
    const double now = test::clock_now();
    fault = pen->read(now).fault;
    pen->write(Vec3(0.0, 0.0, 0.3), now);
    if (fault == DeviceFault::overheated) was_hot = true;
    if (was_hot && bench.motor_force(now) == 0.0) let_go = true;
  });
  wait_until([&] { return bench.motor_force(test::clock_now()) > 0.0; });
  bench.error = 0x200;  // warm motors
  wait_until([&] { return was_hot && let_go; });
  wait_until([&] { return fault == DeviceFault::none; });  // as they are cool again
  pen->stop();
}

}  // namespace test_open_haptics
}  // namespace palpate
