// SPDX-License-Identifier: Apache-2.0
// Measuring a device by its own motors, against the simulated devices, whose truth is known.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "palpate/io/devices/device_body.hpp"
#include "palpate/io/devices/device_probe.hpp"
#include "palpate/io/devices/devices.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_device_probe {

using test::fails_saying;

const HipPath middle({{0.0, Vec3(0.004, -0.003, 0.002)}});

std::unique_ptr<Device> opened(const std::string& options) {
  return open_device("hand:?" + options, middle);
}

// A handle with a constant force on it, such as its weight; and what else a test does to it.
class Wrapped final : public Device {
 public:
  explicit Wrapped(const std::string& options) : inner_(opened(options)), info_(inner_->info()) {}
  // Measured as a real device is: in real time, by a loop of its own thread.
  void be_live() { info_.simulated = false; }
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override {
    if (hang > 0.0 && (was_pushed || !breaks)) {
      std::this_thread::sleep_for(std::chrono::duration<double>(hang));
      if (breaks) faulty_from = t, hang = 0.0;
    }
    HandState hand = inner_->read(t);
    if (t > absent_from) hand.present = false;
    if (t > jumps_at) hand.position.x() += jump;
    if (t > faulty_from) hand.fault = DeviceFault::overheated;
    return hand;
  }
  void write(const Vec3& force, double t) noexcept override {
    largest = std::max(largest, force.norm());
    if (largest > 0.1) was_pushed = true;
    last = force;
    if (t > absent_from + 0.01 || t > faulty_from + 0.01 || t > jumps_at + 0.01)
      largest_after = std::max(largest_after, force.norm());
    inner_->write(force + load, t);
  }
  void enable() override { inner_->enable(); }
  void disable() noexcept override { inner_->disable(); }

  Vec3 load = Vec3::Zero();                                     // [N]
  double absent_from = 1e9, faulty_from = 1e9, jumps_at = 1e9;  // [s]
  double jump = 0.0;                                            // [m]
  double largest = 0.0, largest_after = 0.0;                    // [N]
  Vec3 last = Vec3::Ones();
  double hang = 0.0;    // [s] that a read takes
  bool breaks = false;  // the first such read comes when it is pushed; then it is faulty
  std::atomic<bool> was_pushed{false};

 private:
  std::unique_ptr<Device> inner_;
  DeviceInfo info_;
};

TEST(MeasureDevice, FindsWhatSimulatedDevicesAreMadeOf) {
  struct Case {
    std::string options;
    DeviceBody truth;
  };
  const DeviceBody touch = device_preset("touch").body;
  DeviceBody smooth = touch;
  smooth.friction = 0.05;
  DeviceBody slow = touch;
  slow.mass = 0.12, slow.friction = 0.1, slow.delay = 4e-3;
  for (const auto& [options, truth] :
       {Case{"device=touch&grip=none", touch}, Case{"device=touch&grip=none&friction=0.05", smooth},
        Case{"device=omega&grip=none", device_preset("omega").body},
        Case{"device=touch&grip=none&friction=0.1&device_mass=0.12&delay=4ms", slow}}) {
    const auto device = opened(options);
    const DeviceMeasurement found = measure_device(*device);
    EXPECT_EQ(found.ended, "") << options;
    EXPECT_TRUE(found.doubts.empty()) << options << ": " << found.doubts.front();
    ASSERT_TRUE(found.fit.delay) << options;
    EXPECT_NEAR(found.fit.delay->value, truth.delay, 0.15e-3) << options;
    EXPECT_NEAR(*found.resolution, truth.resolution, 1e-9) << options;
    EXPECT_NEAR(found.tick_rate, 1000.0, 1.0);
    EXPECT_LE(found.largest_force, 0.45 + 1e-12) << options;
    EXPECT_LE(found.farthest, 0.03) << options;
    for (const auto& along : found.fit.axes) {
      ASSERT_TRUE(along) << options;
      EXPECT_NEAR(along->mass.value, truth.mass, 0.15 * truth.mass) << options;
      EXPECT_NEAR(along->damping.value, truth.damping, 0.15 * truth.damping) << options;
      EXPECT_NEAR(along->friction.value, truth.friction, 0.15 * truth.friction + 0.002) << options;
      EXPECT_NEAR(along->load.value, 0.0, 0.01) << options;
    }
  }
}

TEST(MeasureDevice, ProposesWhatDecaysWithoutAHand) {
  const auto device = opened("device=touch&grip=none&friction=0.05");
  const auto proposal = propose(device->info(), measure_device(*device));
  ASSERT_TRUE(proposal);
  const SampledWall truth{.handle = {.mass = 0.06, .damping = 0.7, .stiffness = 0.0},
                          .damping = proposal->damping};
  EXPECT_EQ(proposal->rate, 1000.0);
  EXPECT_EQ(proposal->damping, 2.0);
  // The device states 500 N/m.
  EXPECT_EQ(proposal->stiffness, 500.0);
  EXPECT_LT(proposal->undamped, delayed_stiffness({.handle = truth.handle}));
  EXPECT_GT(proposal->undamped, 0.6 * delayed_stiffness({.handle = truth.handle}));
  EXPECT_FALSE(proposal->load);
  DeviceInfo unstated = device->info();
  unstated.limits.max_stiffness.reset();
  const auto free = propose(unstated, measure_device(*opened("device=touch&grip=none&friction=0")));
  ASSERT_TRUE(free);
  EXPECT_LT(free->stiffness, linear_stiffness(truth, 1e4));
  EXPECT_GT(free->stiffness, 0.7 * linear_stiffness(truth, 1e4));
}

TEST(MeasureDevice, FindsTheWeightThatItHasToHold) {
  Wrapped device("device=touch&grip=none");
  device.load = Vec3(0.0, 0.0, -0.15);  // less than friction holds
  const DeviceMeasurement found = measure_device(device);
  EXPECT_EQ(found.ended, "");
  const auto proposal = propose(device.info(), found);
  ASSERT_TRUE(proposal && proposal->load);
  EXPECT_NEAR(proposal->load->z(), -0.15, 0.015);
  EXPECT_NEAR(proposal->load->head<2>().norm(), 0.0, 0.015);
}

TEST(MeasureDevice, SaysThatItIsUnsureWhereItCannotKnow) {
  const auto held = opened("device=touch&grip=light&friction=0.05");
  const DeviceMeasurement by_a_hand = measure_device(*held);
  EXPECT_FALSE(by_a_hand.doubts.empty());
  EXPECT_FALSE(propose(held->info(), by_a_hand)) << "a hand's spring is not a free handle";

  const auto falcon = opened("device=falcon&grip=none");  // 0.05 N are left to move 250 g
  const DeviceMeasurement vague = measure_device(*falcon);
  ASSERT_FALSE(vague.doubts.empty());
  EXPECT_NE(vague.doubts.front().find("mass and damping stay unknown"), std::string::npos);
  EXPECT_FALSE(propose(falcon->info(), vague));

  const auto stiff = opened("device=touch&grip=none&friction=0.6");
  const DeviceMeasurement stuck = measure_device(*stiff);
  ASSERT_FALSE(stuck.doubts.empty());
  EXPECT_NE(stuck.doubts.front().find("hardly moved under 0.45 N"), std::string::npos);
  EXPECT_FALSE(propose(stiff->info(), stuck));
}

// Hazard: probe
TEST(MeasureDevice, EndsWithoutAForceWhenTheHandleGoesTooFarOrTheDeviceLetsGo) {
  const auto ends = [](Wrapped& device, const char* word) {
    const DeviceMeasurement found = measure_device(device);
    EXPECT_NE(found.ended.find(word), std::string::npos) << found.ended;
    EXPECT_GT(device.largest, 0.1) << "it was under way";
    EXPECT_EQ(device.largest_after, 0.0) << word;
    EXPECT_TRUE(device.last.isZero()) << word;
  };
  Wrapped far("device=touch&grip=none");
  far.jumps_at = 3.0;
  far.jump = 0.1;
  ends(far, "mm away");
  Wrapped fast("device=touch&grip=none");
  fast.jumps_at = 3.0;
  fast.jump = 0.012;
  ends(fast, "faster than");
  Wrapped absent("device=touch&grip=none");
  absent.absent_from = 3.0;
  ends(absent, "reports no hand");
  Wrapped faulty("device=touch&grip=none");
  faulty.faulty_from = 3.0;
  ends(faulty, "cool");

  Wrapped falling("device=touch&grip=none");
  falling.load = Vec3(0.0, 0.0, -1.5);
  const DeviceMeasurement found = measure_device(falling);
  EXPECT_NE(found.ended.find("the handle"), std::string::npos) << found.ended;
  EXPECT_LE(falling.largest, 0.45 + 1e-12);
  EXPECT_FALSE(propose(falling.info(), found));
}

const std::string too_busy = "the computer was too busy";

// Measures in real time, with `prepare`d devices, until the stall that the test makes has come: a
// busy computer may stall before, which has to be said, too.
DeviceMeasurement measured_with_a_stall(
    const std::function<std::function<bool()>(Wrapped&, ProbeOptions&)>& prepare) {
  for (int attempt = 0; attempt < 10; ++attempt) {
    Wrapped device("device=touch&grip=none");
    device.be_live();
    ProbeOptions options;
    const std::function<bool()> has_stalled = prepare(device, options);
    try {
      DeviceMeasurement found = measure_device(device, options);
      EXPECT_NE(found.ended.find(too_busy), std::string::npos) << found.ended;
      EXPECT_TRUE(device.last.isZero());
      EXPECT_FALSE(propose(device.info(), found));
      if (has_stalled()) return found;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(too_busy), std::string::npos) << error.what();
    }
  }
  ADD_FAILURE() << "the machine stood still in each attempt";
  return {};
}

TEST(MeasureDevice, SaysThatTheMeasuringThreadStalled) {
  const DeviceMeasurement found = measured_with_a_stall([](Wrapped& device, ProbeOptions& options) {
    const auto stalls = std::make_shared<int>(0);
    options.cancelled = [&device, stalls] {
      if (device.was_pushed) {
        ++*stalls;
        std::this_thread::sleep_for(std::chrono::milliseconds(350));
      }
      return *stalls > 3;
    };
    return [stalls] { return *stalls > 0; };
  });
  EXPECT_GE(found.stalls, 1);
  EXPECT_GE(found.longest_stall, 0.35);
  ASSERT_FALSE(found.doubts.empty());
  EXPECT_NE(found.doubts.back().find("end other programs"), std::string::npos);
}

// As the watchdog of a firmware does.
TEST(MeasureDevice, SaysThatADeviceFailedAfterAStall) {
  const DeviceMeasurement found = measured_with_a_stall([](Wrapped& device, ProbeOptions&) {
    device.hang = 0.03;
    device.breaks = true;
    return [&device] { return device.hang == 0.0; };
  });
  EXPECT_NE(found.ended.find("cool"), std::string::npos) << found.ended;
}

TEST(MeasureDevice, SaysThatStallsNeverLetTheForceRise) {
  Wrapped device("device=touch&grip=none");
  device.be_live();
  device.hang = 0.03;
  EXPECT_TRUE(fails_saying([&] { return measure_device(device); }, too_busy, "gives no force",
                           "end other programs"));
}

// Hazard: probe
TEST(MeasureDevice, RefusesWhatItCannotMeasure) {
  const auto mouse = open_device("mouse:");
  EXPECT_TRUE(fails_saying([&] { return measure_device(*mouse); }, "mouse:", "no motors"));
  const auto touch = opened("device=touch&grip=none");
  EXPECT_TRUE(
      fails_saying([&] { return measure_device(*touch, {.force = 0.5}); }, "force", "0.45"));
  EXPECT_TRUE(fails_saying([&] { return measure_device(*touch, {.rate = 10.0}); }, "rate", "500"));
  bool asked = false;
  const DeviceMeasurement found = measure_device(*touch, {.cancelled = [&asked] {
    asked = true;
    return true;
  }});
  EXPECT_TRUE(asked);
  EXPECT_EQ(found.ended, "it was cancelled");
  EXPECT_EQ(found.largest_force, 0.0);

  Wrapped dead("device=touch&grip=none");
  dead.absent_from = -1.0;
  EXPECT_TRUE(fails_saying([&] { return measure_device(dead); }, "it gives no force"));
  EXPECT_EQ(dead.largest, 0.0);
}

}  // namespace test_device_probe
}  // namespace palpate
