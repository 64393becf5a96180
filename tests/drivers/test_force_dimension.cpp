// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include <gtest/gtest.h>

#include "tests/drivers/fake_device_test.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/errors.hpp"

namespace palpate {
namespace test_force_dimension {

class ForceDimension : public test::FakeDeviceTest {
 protected:
  ForceDimension()
      : FakeDeviceTest("force-dimension", "PALPATE_FORCE_DIMENSION", "force-dimension") {}
};

TEST_F(ForceDimension, TellsWhatItIs) {
  bench.devices = 2;
  const auto arm = open("force-dimension:10518?watchdog=10ms&max_force=5");
  const DeviceInfo& info = arm->info();
  EXPECT_EQ(info.serial, "10518");
  EXPECT_EQ(info.limits.max_force, 5.0);
  EXPECT_EQ(info.limits.max_stiffness, 5000.0);
  EXPECT_EQ(info.reach->radius, 0.075);
  EXPECT_DOUBLE_EQ(*info.watchdog, 0.010);
  EXPECT_DOUBLE_EQ(bench.watchdog, 0.010) << "of the firmware";
  EXPECT_FALSE(bench.force_on) << "not before enable";
}

TEST_F(ForceDimension, BringsItsAxesIntoOurs) {
  const auto arm = open("force-dimension:");
  arm->enable();
  bench.began = test::clock_now() - 2.2;
  const auto place = bench.hand(bench.began + 2.2);  // x to the right, y away, z up
  EXPECT_GT(std::abs(place[0]), 1e-3);
  const HandState hand = arm->read(0.0);
  EXPECT_NEAR(hand.position.x(), place[0], 5e-4);
  EXPECT_NEAR(hand.position.y(), place[1], 5e-4);
  EXPECT_NEAR(hand.position.z(), place[2], 5e-4);
  EXPECT_EQ(hand.buttons, 1U);
  arm->write(Vec3(0.1, 0.2, 0.3), 0.0);  // to the right, away, up
  EXPECT_EQ(bench.force[0], -0.2) << "x is towards the user";
  EXPECT_EQ(bench.force[1], 0.1);
  EXPECT_EQ(bench.force[2], 0.3);
}

// Hazard: torque
TEST_F(ForceDimension, SendsATorqueWhereTheWristHasMotors) {
  EXPECT_EQ(open("force-dimension:")->info().limits.max_torque, 0.0) << "omega.3";
  bench.active_wrist = bench.wrist_is_off = true;
  EXPECT_EQ(open("force-dimension:")->info().limits.max_torque, 0.0) << "a wrist that is off";
  bench.wrist_is_off = false;
  EXPECT_DOUBLE_EQ(open("force-dimension:?max_force=6")->info().limits.max_torque, 0.1);
  const auto arm = open("force-dimension:");
  EXPECT_DOUBLE_EQ(arm->info().limits.max_torque, 0.2);
  EXPECT_TRUE(arm->read(0.0).orientation.has_value());
  const Wrench wrench{{0.1, 0.2, 0.3}, {0.01, 0.02, 0.03}};  // right, away, up
  arm->write(wrench, 0.0);
  EXPECT_EQ(bench.torque[2], 0.0) << "not enabled";
  arm->enable();
  arm->write(wrench, 0.001);
  EXPECT_EQ(bench.force[0], -0.2) << "x is towards the user";
  EXPECT_EQ(bench.torque[0], -0.02);
  EXPECT_EQ(bench.torque[1], 0.01);
  EXPECT_EQ(bench.torque[2], 0.03);
  arm->write(Wrench{Vec3::Zero(), Vec3::UnitZ()}, 0.002);
  EXPECT_DOUBLE_EQ(bench.torque[2], 0.2) << "the SDK was told the limit";
  arm->write(Vec3::UnitZ(), 0.003);
  EXPECT_EQ(bench.torque[2], 0.0) << "a force alone leaves no torque";
  arm->write(wrench, 0.004);
  arm->disable();
  EXPECT_EQ(bench.torque[2], 0.0);
  EXPECT_FALSE(bench.force_on);
  arm->write(wrench, 0.005);
  EXPECT_EQ(bench.torque[2], 0.0) << "disabled";
}

TEST_F(ForceDimension, SwitchesItsForcesOffAndOn) {
  const auto arm = open("force-dimension:");
  arm->write(Vec3::UnitZ(), 0.0);
  EXPECT_EQ(bench.force[2], 0.0) << "not enabled";
  arm->enable();
  EXPECT_TRUE(bench.force_on);
  arm->write(Vec3::UnitZ(), 0.001);
  EXPECT_EQ(bench.motor_force(test::clock_now()), 1.0);
  arm->disable();
  EXPECT_EQ(bench.motor_force(test::clock_now()), 0.0);
  arm->write(Vec3::UnitZ(), 0.002);
  EXPECT_EQ(bench.force[2], 0.0);
  EXPECT_FALSE(bench.force_on);
}

TEST_F(ForceDimension, KeepsForcesOffAfterItsFirmwareTookThemUntilNoneIsAskedForHalfASecond) {
  bench.active_wrist = true;
  const auto arm = open("force-dimension:");
  arm->enable();
  double t = 0.0;
  const auto tick = [&](double newtons) {
    t += 0.001;
    const HandState hand = arm->read(t);
    arm->write(newtons * Vec3::UnitZ(), t);
    return hand;
  };
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(tick(0.4).present);
  bench.too_fast = true;
  for (int i = 0; i < 20; ++i) tick(0.4);
  const HandState hand = tick(0.0);
  EXPECT_FALSE(hand.present);
  EXPECT_EQ(hand.fault, DeviceFault::refused_command);
  EXPECT_NE(arm->fault_text().find("too fast"), std::string::npos) << arm->fault_text();
  for (int i = 0; i < 600; ++i) {
    static_cast<void>(arm->read(t += 0.001));
    arm->write(Wrench{Vec3::Zero(), 0.01 * Vec3::UnitZ()}, t);
  }
  EXPECT_FALSE(bench.force_on) << "a torque is asked for";
  for (int i = 0; i < 490; ++i) tick(0.0);
  EXPECT_FALSE(bench.force_on);
  for (int i = 0; i < 30; ++i) tick(0.0);
  EXPECT_TRUE(bench.force_on);
  EXPECT_TRUE(tick(0.0).present);
  EXPECT_EQ(arm->fault_text(), "");
}

TEST_F(ForceDimension, CalibratesOnlyWhenAskedAndOnlyWhereItMust) {
  EXPECT_EQ(bench.calibrations, 0);
  open("force-dimension:?calibrate");
  EXPECT_EQ(bench.calibrations, 0) << "it is calibrated";
  bench.calibrated = false;
  EXPECT_TRUE(test::fails_saying([&] { return open("force-dimension:"); }, "not calibrated"));
  EXPECT_EQ(bench.calibrations, 0);
  open("force-dimension:?calibrate");
  EXPECT_EQ(bench.calibrations, 1);
  EXPECT_EQ(bench.opens, bench.closes);
}

TEST_F(ForceDimension, WorksWithoutDrdButDoesNotCalibrateThen) {
  const test::Environment dhd("PALPATE_FORCE_DIMENSION", PALPATE_FAKES "/force-dimension-dhd");
  EXPECT_TRUE(open("force-dimension:")->read(0.0).present);
  bench.calibrated = false;
  EXPECT_TRUE(test::fails_saying([&] { return open("force-dimension:?calibrate"); },
                                 "cannot calibrate it", "install libdrd"));
}

}  // namespace test_force_dimension
}  // namespace palpate
