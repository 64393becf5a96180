// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <limits>
#include <new>
#include <thread>

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "palpate/io/devices/device_guard.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/last_gate.h"

#include "tests/support/errors.hpp"
#include "tests/support/push.hpp"

namespace palpate {
namespace test_device_guard {

constexpr double beat_time = 0.020;  // [s]

// Hazard: dead-process
TEST(GuardGate, PassesForcesWhileTheyComeAndAfterALapseOnlyFromZeroOn) {
  GuardGate gate(beat_time);
  const Vec3 force(0.0, 0.0, 1.0);
  const auto pass = [&](double now, std::uint64_t beats, const Vec3& wanted) {
    const Wrench passed = gate.pass(now, beats, {wanted, 0.01 * wanted});
    EXPECT_TRUE(passed.torque == 0.01 * passed.force);
    return passed.force;
  };
  EXPECT_EQ(pass(0.000, 1, force), Vec3::Zero()) << "not before the first zero force";
  EXPECT_EQ(pass(0.001, 2, Vec3::Zero()), Vec3::Zero());
  EXPECT_EQ(pass(0.002, 3, force), force);
  EXPECT_EQ(pass(0.021, 3, force), force);
  EXPECT_EQ(pass(0.023, 3, force), Vec3::Zero());
  EXPECT_TRUE(gate.closed());
  EXPECT_EQ(pass(0.024, 4, force), Vec3::Zero()) << "a process that goes on in mid-tick";
  EXPECT_EQ(pass(0.025, 5, Vec3::Zero()), Vec3::Zero());
  EXPECT_EQ(pass(0.026, 6, force), force);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(pass(0.027, 7, Vec3::Constant(nan)), Vec3::Zero());
  EXPECT_EQ(pass(0.028, 8, force), Vec3::Zero());
  EXPECT_EQ(pass(0.029, 9, Vec3::Zero()), Vec3::Zero());
  EXPECT_EQ(gate.pass(0.030, 10, {force, Vec3(0.0, nan, 0.0)}).force, Vec3::Zero());
  EXPECT_TRUE(gate.closed());
}

// What the device in the guard saw, in memory that test, session and guard share.
struct Seen {
  std::atomic<int> writes{0};
  std::atomic<double> force{0.0};    // [N] the newest
  std::atomic<double> largest{0.0};  // [N] so far
  std::atomic<int> late_forces{0};   // forces after beat_time without a change
  std::atomic<bool> enabled{false}, closed{false};
  std::atomic<int> session{0}, beats{0};  // process that writes; how often it did
};

// Forces count up in the last digits, so that the device sees whether one is new.
class WitnessDevice final : public Device {
 public:
  explicit WitnessDevice(Seen& seen) : seen_(seen) {
    info_.uri = "witness:";
    info_.limits.max_force = 2.5;
    info_.delay = 0.1;
    info_.reach = DeviceReach::ball(0.2);
  }
  ~WitnessDevice() override { seen_.closed = true; }
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override {
    HandState state;
    state.position = Vec3(0.1, 0.2, 0.3);
    state.buttons = 5U;
    return state;
  }
  void write(const Vec3& force, double t) noexcept override {
    if (force != last_) changed_ = t;
    last_ = force;
    if (!force.isZero(0.0) && t - changed_ > beat_time) ++seen_.late_forces;
    seen_.force = force.norm();
    seen_.largest = std::max(seen_.largest.load(), force.norm());
    ++seen_.writes;
  }
  void enable() override { seen_.enabled = true; }
  void disable() noexcept override { seen_.enabled = false; }

 private:
  Seen& seen_;
  DeviceInfo info_;
  Vec3 last_ = Vec3::Zero();
  double changed_ = 0.0;  // [s]
};

class DeviceGuard : public ::testing::Test {
 protected:
  DeviceGuard()
      : seen(*new (mmap(nullptr, sizeof(Seen), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS,
                        -1, 0)) Seen) {}
  ~DeviceGuard() override {
    if (child_ > 0) {
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
    }
    EXPECT_TRUE(wait_for([&] { return seen.closed.load() || seen.writes == 0; }));
    munmap(&seen, sizeof(Seen));
  }

  // Waits up to a minute, which is for tests that hang.
  template <class Condition>
  static bool wait_for(const Condition& condition) {
    for (int i = 0; i < 60'000 && !condition(); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return condition();
  }

  [[nodiscard]] std::unique_ptr<Device> open() {
    return open_guarded([this] { return std::make_unique<WitnessDevice>(seen); },
                        {.beat_time = beat_time});
  }

  // Forks a process that pushes at its device; returns when the device gives its force.
  void start_session() {
    child_ = fork();
    if (child_ == 0) {
      const std::unique_ptr<Device> device = open();
      device->enable();
      for (int i = 0; i < 1'000'000; ++i) {
        const HandState hand = device->read(i * 1e-3);
        const bool pushes = hand.present && i > 0;  // as the safety chain: else zero
        test::push(*device, pushes ? 1.0 + 1e-9 * i : 0.0, i * 1e-3);
        ++seen.beats;
        std::this_thread::sleep_for(std::chrono::microseconds(500));
      }
      _exit(0);
    }
    ASSERT_TRUE(wait_for([&] { return seen.force > 0.9; }));
  }

  Seen& seen;
  pid_t child_ = -1;
};

// Hazard: dead-process
TEST_F(DeviceGuard, TakesTheForceOffWhenItsSessionIsKilled) {
  start_session();
  kill(child_, SIGKILL);
  waitpid(child_, nullptr, 0);
  child_ = -1;
  EXPECT_TRUE(wait_for([&] { return seen.closed.load(); })) << "the guard ends, too";
  EXPECT_EQ(seen.force, 0.0);
  EXPECT_FALSE(seen.enabled);
  EXPECT_EQ(seen.late_forces, 0);
}

// Hazard: dead-process
TEST_F(DeviceGuard, TakesTheForceOffWhileItsSessionIsStopped) {
  start_session();
  kill(child_, SIGSTOP);
  EXPECT_TRUE(wait_for([&] { return seen.force == 0.0; }));
  EXPECT_EQ(seen.late_forces, 0);
  EXPECT_FALSE(seen.closed);
  // It goes on, lets go, and pushes again.
  kill(child_, SIGCONT);
  EXPECT_TRUE(wait_for([&] { return seen.force > 0.9; }));
  EXPECT_EQ(seen.late_forces, 0);
}

// Hazard: dead-process
TEST_F(DeviceGuard, ShowsTheDeviceAsItIsAndStatesAWatchdog) {
  const std::unique_ptr<Device> device = open();
  EXPECT_EQ(device->info().uri, "witness:");
  EXPECT_EQ(device->info().limits.max_force, 2.5);
  EXPECT_EQ(device->info().delay, 0.1);
  EXPECT_FALSE(device->info().damping);
  ASSERT_TRUE(device->info().reach);
  EXPECT_EQ(device->info().reach->radius, 0.2);
  EXPECT_EQ(device->info().watchdog, beat_time);
  HandState state;
  double t = 0.0;
  // The gate opens with the first zero force, which the hand shows a turn later.
  EXPECT_TRUE(wait_for([&] {
    t += 1e-3;
    device->write(Vec3::Zero(), t);
    state = device->read(t);
    return state.present;
  }));
  EXPECT_EQ(state.position, Vec3(0.1, 0.2, 0.3));
  EXPECT_EQ(state.buttons, 5U);
  EXPECT_EQ(state.fault, DeviceFault::none);
}

// Hazard: dead-process
TEST_F(DeviceGuard, PassesNoForceOfADisabledDevice) {
  const std::unique_ptr<Device> device = open();
  double t = 0.0;
  int calls = 0;
  const auto push = [&] { test::push(*device, ++calls % 8 < 4 ? 0.0 : 1.0, t += 1e-3); };
  const auto push_for = [&](int turns) {
    const int end = seen.writes + turns;
    const int last = calls + turns;
    seen.largest = 0.0;
    wait_for([&] {
      push();
      return seen.writes >= end && calls > last;
    });
    return seen.largest.load();
  };
  EXPECT_EQ(push_for(50), 0.0);
  device->enable();
  EXPECT_TRUE(seen.enabled);
  EXPECT_TRUE(wait_for([&] {
    push();
    return seen.largest == 1.0;
  }));
  device->disable();
  EXPECT_TRUE(wait_for([&] { return !seen.enabled; }));
  push_for(2);
  EXPECT_EQ(push_for(50), 0.0);
}

// Hazard: dead-process
TEST_F(DeviceGuard, SaysWhyADeviceDidNotOpen) {
  const auto failing = [] {
    return open_guarded([]() -> std::unique_ptr<Device> {
      throw Error("arm:1", "its cable is out", "plug it in");
    });
  };
  EXPECT_TRUE(test::fails_saying(failing, "arm:1", "cable", "plug it in"));
  EXPECT_TRUE(
      test::fails_saying([&] { return open_guarded(nullptr, {.beat_time = 1.0}); }, "beat_time"));
}

}  // namespace test_device_guard
}  // namespace palpate
