// SPDX-License-Identifier: Apache-2.0
// The loop with a device that drives it, that stops answering, or that reports faults.
#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/servo_loop.hpp"

#include "tests/servo/fake_device.hpp"
#include "tests/support/comes_true.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/patient.hpp"
#include "tests/support/stall_watch.hpp"

namespace palpate {
namespace test_device_loop {

using test::FakeDevice;

// A device whose own thread calls the cycle, as a vendor's scheduler does.
class DrivingDevice final : public Device {
 public:
  ~DrivingDevice() override { stop(); }
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override { return {.position = {0, 0, 0.02}}; }
  void write(const Vec3& force, double /*t*/) noexcept override {
    last_write_was_zero = force.isZero();
    writer = std::this_thread::get_id();
    ++writes;
  }
  void enable() override {
    if (refuses) throw Error("driving:", "it refuses", "leave it");
    enabled = true;
  }
  void disable() noexcept override { enabled = false; }
  [[nodiscard]] bool drives() const override { return true; }
  void start(CycleCallback cycle) override {
    thread = std::thread([this, cycle = std::move(cycle)] {
      double last = monotonic_now();
      while (!ending) {
        const double now = monotonic_now();
        longest_gap = std::max(longest_gap.load(), now - last);
        last = now;
        rests = silent.load();
        if (!rests) {
          cycle();
          ++calls;
        }
        std::this_thread::yield();
      }
    });
    id = thread.get_id();
  }
  void stop() noexcept override {
    ending = true;
    if (thread.joinable()) thread.join();
  }

  std::atomic<bool> silent{false}, ending{false}, enabled{false}, refuses{false};
  std::atomic<bool> rests{false};  // it has seen that it is to be silent
  std::atomic<int> calls{0}, writes{0};
  std::atomic<bool> last_write_was_zero{false};
  std::atomic<double> longest_gap{0.0};  // [s] for which its thread did not run
  std::thread::id writer, id;
  std::thread thread;

 private:
  DeviceInfo info_{
      .uri = "driving:", .kind = "driving", .limits = {}, .rate = 2000.0, .watchdog = 0.01};
};

void wait_until(const std::function<bool()>& done) {
  EXPECT_TRUE(test::comes_true(done)) << "it waited for a minute";
}

// Hazard: session-stops
TEST(DrivenLoop, RunsItsCyclesOnTheDevicesThreadAndKeepsTheirTiming) {
  DrivingDevice device;
  ServoLoop loop(make_method("paper"), device);
  auto reader = loop.cycle().reader();
  loop.start();
  EXPECT_TRUE(device.enabled);
  EXPECT_EQ(loop.rate(), 2000.0);
  wait_until([&] { return device.calls > 100; });
  loop.stop();
  EXPECT_TRUE(device.last_write_was_zero);
  EXPECT_FALSE(device.enabled);
  std::uint64_t seen = 0;
  // This thread may come late: then the oldest have gone.
  for (ServoTick record{}; reader.try_pop(record);)
    EXPECT_EQ(record.number, seen++ + reader.lost());
  const std::uint64_t ticks = seen + reader.lost();
  EXPECT_GE(ticks, 100U);
  EXPECT_EQ(loop.timing().compute.count(), ticks);
  EXPECT_EQ(loop.timing().wake_up.count(), ticks - 1) << "the first has none before it";
  EXPECT_EQ(device.writes, static_cast<int>(ticks) + 1);
}

// Hazard: session-stops
TEST(DrivenLoop, SendsTheLastZeroOnTheDevicesThread) {
  constexpr double stall = 0.04;  // [s] it is waited for for 50 ms
  for (int attempt = 0; attempt < 10; ++attempt) {
    DrivingDevice device;
    ServoLoop loop(make_method("paper"), device);
    loop.start();
    wait_until([&] { return device.calls > 100; });
    loop.stop();
    EXPECT_TRUE(device.last_write_was_zero);
    if (device.writer == device.id) return;
    ASSERT_GT(device.longest_gap, stall) << "written by another thread, although its own ran";
  }
  FAIL() << "the machine stood still in each attempt";
}

// Hazard: hang, session-stops
TEST(DrivenLoop, DisablesADeviceWhoseCallbacksStopAndEnablesItWhenTheyComeAgain) {
  DrivingDevice device;
  ServoLoop loop(make_method("paper"), device);
  loop.start();
  device.silent = true;
  wait_until([&] { return device.rests && !device.enabled && !loop.trouble().empty(); });
  EXPECT_TRUE(loop.trouble().starts_with("no tick for")) << loop.trouble();
  device.silent = false;
  wait_until([&] { return device.enabled.load(); });
  device.silent = true;
  wait_until([&] { return device.rests && !device.enabled && !loop.trouble().empty(); });
  device.refuses = true;
  device.silent = false;
  wait_until([&] { return loop.trouble() == "driving:: it refuses; leave it"; });
  EXPECT_FALSE(device.enabled);
}

// Hazard: session-stops
TEST(DrivenLoop, SendsZeroByItselfWhereTheCallbacksHaveEnded) {
  DrivingDevice device;
  ServoLoop loop(make_method("paper"), device);
  loop.start();
  device.silent = true;
  wait_until([&] { return device.rests.load(); });
  const int calls = device.calls;
  loop.stop();
  EXPECT_EQ(device.calls, calls);
  EXPECT_TRUE(device.last_write_was_zero);
  EXPECT_EQ(device.writer, std::this_thread::get_id());
  EXPECT_FALSE(device.enabled);
}

// Hazard: session-stops
TEST(DrivenLoop, RefusesADeviceThatCannotBeEnabledOrNeverCalls) {
  DrivingDevice device;
  device.refuses = true;
  ServoLoop loop(make_method("paper"), device);
  EXPECT_TRUE(test::fails_saying([&] { return loop.start(), 0; }, "driving:", "refuses"));
  EXPECT_EQ(device.calls, 0);

  DrivingDevice mute;
  mute.silent = true;
  ServoLoop waiting(make_method("paper"), mute);
  EXPECT_TRUE(test::fails_saying([&] { return waiting.start(), 0; }, "driving:", "does not call"));
  EXPECT_FALSE(mute.enabled);
}

struct Hang {
  std::atomic<bool> asked{false};
  std::atomic<bool> is_on{false};
  std::atomic<double> since{0.0};  // [s]
  std::atomic<bool> pushes{false};

  void begin() {
    is_on = false;
    asked = true;
    wait_until([this] { return is_on.load(); });
  }
  void end() { asked = false; }
};

// A method that takes as long, and asks for a force of 1 N when, the test likes.
class HangingMethod final : public Method {
 public:
  explicit HangingMethod(Hang& hang) : hang_(hang) {}
  void seat(const Vec3& /*proxy*/) noexcept override {}
  void observe(const Observation& /*seen*/) noexcept override {}
  Tick tick(const Vec3& hip, double t) noexcept override {
    while (hang_.asked) {
      if (!hang_.is_on) {
        hang_.since = monotonic_now();
        hang_.is_on = true;
      }
      std::this_thread::yield();
    }
    Tick tick = free_tick(hip, t, -1);
    if (!hang_.pushes) return tick;
    tick.proxy = hip + Vec3(0, 0, 0.01);
    tick.normal = Vec3::UnitZ();
    tick.force.z() = 1.0;
    return tick;
  }
  void set_parameters(const Parameters& /*parameters*/) noexcept override {}

 private:
  Hang& hang_;
};

// Hazard: hang, session-stops
TEST(ServoLoop, DisablesThePolledDeviceOfAMethodThatHangs) {
  Hang hang;
  FakeDevice device;
  ServoLoop loop(std::make_unique<HangingMethod>(hang), device);
  loop.start();
  wait_until([&] { return loop.statistics().ticks > 3; });
  hang.begin();
  wait_until([&] { return device.disables >= device.enables; });
  const int by_watch = device.disables;
  std::thread stopper([&] { loop.stop(); });
  wait_until([&] { return device.disables > by_watch; });  // by stop(), although it hangs
  hang.end();
  stopper.join();
  EXPECT_TRUE(device.force.isZero());
}

// When it was disabled last [s].
class TimedDevice final : public FakeDevice {
 public:
  void disable() noexcept override {
    disabled_at = monotonic_now();
    FakeDevice::disable();
  }
  std::atomic<double> disabled_at{0.0};
};

// Hazard: session-stops
TEST(ServoLoop, DisablesADeviceWithAForceLongBeforeTheWatchTime) {
  for (int attempt = 0; attempt < 10; ++attempt) {
    Hang hang;
    TimedDevice device;
    ServoSettings settings;
    settings.safety = test::patient();
    ServoLoop loop(std::make_unique<HangingMethod>(hang), device, settings, {.watch_time = 1.0});
    const CycleStatistics& said = loop.statistics();
    loop.start();
    const auto cloud = std::make_shared<PointCloud>(test::flat_grid(0.0, 2e-3, 10));
    loop.cycle().put_frame(cloud, monotonic_now(), monotonic_now());
    wait_until([&] { return said.frames_adopted > 0; });
    // The hand engages while nothing is asked for, and never after.
    const std::uint64_t ticks = said.ticks;
    wait_until([&] { return said.ticks > ticks + 1 && (said.safety & disengaged) == 0; });
    hang.pushes = true;
    wait_until([&] { return said.force_out.load(); });
    const test::StallWatch machine;
    hang.begin();
    const double began = hang.since;
    const auto is_disabled = [&] { return device.disabled_at > began; };
    // A stall before may have had the device disabled, or the force set to zero: not by the hang.
    const bool was_out = said.force_out && (device.enables > device.disables || is_disabled());
    wait_until([&] { return is_disabled() || !was_out || monotonic_now() > began + 2.0; });
    const double took = is_disabled() ? device.disabled_at - began : 2.0;
    hang.end();
    if (!was_out) continue;
    if (took < 0.5) return;
    ASSERT_GT(machine.longest(), 0.1) << "disabled after " << took << " s";
  }
  FAIL() << "the machine stood still in each attempt";
}

// Hazard: session-stops, hanging-driver
TEST(ServoLoop, StopsAlthoughAMethodHangsAndEndsItsThreadWhenThatReturns) {
  Hang hang;
  FakeDevice device;
  int enables = 0;
  {
    ServoLoop loop(std::make_unique<HangingMethod>(hang), device);
    loop.start();
    wait_until([&] { return loop.statistics().ticks > 3; });
    hang.begin();
    EXPECT_FALSE(loop.stop());
    EXPECT_FALSE(loop.has_ended());
    EXPECT_TRUE(loop.trouble().starts_with("the method or the device's driver")) << loop.trouble();
    const int disables = device.disables;
    EXPECT_GT(disables, 0);
    EXPECT_FALSE(loop.stop()) << "a second stop";
    EXPECT_GT(device.disables, disables);
    enables = device.enables;
    hang.end();
  }
  EXPECT_TRUE(device.force.isZero());
  EXPECT_EQ(device.enables, enables) << "never again";
}

// Hazard: session-stops
TEST(ServoLoop, DisablesTheDeviceAtOnceByASecondStopWhileTheFirstWaits) {
  Hang hang;
  FakeDevice device;
  ServoLoop loop(std::make_unique<HangingMethod>(hang), device);
  loop.start();
  wait_until([&] { return loop.statistics().ticks > 3; });
  hang.begin();
  bool first = true;
  std::thread stopper([&] { first = loop.stop(); });
  wait_until([&] { return device.disables > 0; });
  const int disables = device.disables;
  EXPECT_FALSE(loop.stop());
  EXPECT_GT(device.disables, disables);
  stopper.join();
  EXPECT_FALSE(first);
  hang.end();
}

// Hazard: session-stops, hanging-driver
TEST(DrivenLoop, StopsAlthoughACallbackHangsAndEndsItWhenThatReturns) {
  Hang hang;
  DrivingDevice device;
  {
    ServoLoop loop(std::make_unique<HangingMethod>(hang), device);
    loop.start();
    wait_until([&] { return device.calls > 3; });
    hang.begin();
    EXPECT_FALSE(loop.stop());
    EXPECT_FALSE(device.enabled);
    EXPECT_FALSE(device.ending) << "the driver would wait for its callback";
    hang.end();
  }
  EXPECT_TRUE(device.ending);
  EXPECT_TRUE(device.last_write_was_zero);
  EXPECT_FALSE(device.enabled);
}

// A device whose motors can only be switched on when the test likes.
struct SlowlyEnabledDevice final : Device {
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override { return {}; }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}
  void enable() override {
    while (enable_hangs) {
      is_hanging = true;
      std::this_thread::yield();
    }
    enabled = true;
    if (is_hanging) has_returned = true;
  }
  void disable() noexcept override {
    enabled = false;
    ++disables;
  }

  std::atomic<bool> enable_hangs{false}, enabled{false}, is_hanging{false}, has_returned{false};
  std::atomic<int> disables{0};

 private:
  DeviceInfo info_{.uri = "slow:", .kind = "slow", .limits = {}};
};

// Hazard: session-stops, hanging-driver
TEST(ServoLoop, StopsAlthoughTheDeviceHangsWhileItIsEnabledAndLeavesItDisabled) {
  Hang hang;
  SlowlyEnabledDevice device;
  {
    ServoLoop loop(std::make_unique<HangingMethod>(hang), device);
    loop.start();
    wait_until([&] { return loop.statistics().ticks > 3; });
    device.enable_hangs = true;
    hang.begin();
    wait_until([&] { return !device.enabled; });
    hang.end();
    wait_until([&] { return device.is_hanging.load(); });
    const int disables = device.disables;
    EXPECT_FALSE(loop.stop());
    EXPECT_GT(device.disables, disables) << "although the thread that watches can't";
    device.enable_hangs = false;
    wait_until([&] { return device.has_returned && !device.enabled; });
  }
  EXPECT_FALSE(device.enabled);
}

// Hazard: session-stops
TEST(ServoLoop, RefusesAWatchTimeOutOfRange) {
  FakeDevice device;
  EXPECT_THROW(ServoLoop(make_method("paper"), device, {}, {.watch_time = 0.0}), Error);
}

// In contact, with 2 N or so on the hand.
struct Pressing {
  Pressing() : cycle(make_method("paper"), device), reader(cycle.reader()) {
    device.hand.position = {0, 0, 0.02};
    for (int i = 0; i < 2000; ++i) run();
    while (device.hand.position.z() > -0.003) {
      device.hand.position.z() -= 5e-5;
      run();
    }
    for (int i = 0; i < 500; ++i) run();
  }
  ServoTick run() {
    t += 1e-3;
    if (++ticks % 30 == 1) cycle.put_frame(cloud, t, t);
    cycle.run({.t = t});
    ServoTick record{};
    EXPECT_TRUE(reader.try_pop(record));
    return record;
  }
  std::shared_ptr<PointCloud> cloud =
      std::make_shared<PointCloud>(test::flat_grid(0.0, 1.5e-3, 30), Vec3(0, 0, 1));
  FakeDevice device;
  Cycle cycle;
  TickRing<ServoTick>::Reader reader;
  double t = 10.0;
  int ticks = 0;
};

// Hazard: nobody-holds
TEST(DeviceFault, TakesTheForceAwayInTwoTicksAndIsInTheRecord) {
  Pressing session;
  ASSERT_GT(session.run().force.norm(), 1.0);
  session.device.hand.fault = DeviceFault::overheated;
  session.run();
  const ServoTick record = session.run();
  EXPECT_TRUE(record.force.isZero()) << record.force.transpose();
  EXPECT_TRUE(session.device.force.isZero());
  EXPECT_NE(record.hand & hand_fault, 0U);
  EXPECT_NE(record.hand & hand_present, 0U);
  EXPECT_EQ(fault_of(record.hand), DeviceFault::overheated);
  EXPECT_NE(record.safety & disengaged, 0U);
  EXPECT_EQ(session.cycle.statistics().hand, record.hand);

  session.device.hand.fault = DeviceFault::none;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(session.run().force.isZero()) << "still pressing: the engage gate stays closed";
  }
}

// Hazard: nobody-holds
TEST(DeviceFault, IsSaidInWordsByTheLoop) {
  FakeDevice device;
  ServoLoop loop(make_method("paper"), device);
  EXPECT_EQ(loop.trouble(), "") << "before it began";
  device.hand.fault = DeviceFault::emergency_stop;
  loop.start();
  wait_until([&] { return !loop.trouble().empty(); });
  loop.stop();
  EXPECT_EQ(loop.trouble(), describe(DeviceFault::emergency_stop));
  device.text = "motor 3 is at 80 degrees; wait";
  EXPECT_EQ(loop.trouble(), device.text) << "the device knows better";
}

// Hazard: nobody-holds
TEST(DeviceFault, HasANameAndASentenceEach) {
  EXPECT_EQ(to_string(DeviceFault::none), "none");
  EXPECT_EQ(describe(DeviceFault::none), "");
  for (int i = 1; i <= static_cast<int>(DeviceFault::other); ++i) {
    EXPECT_FALSE(describe(static_cast<DeviceFault>(i)).empty()) << i;
  }
  EXPECT_EQ(to_string(static_cast<DeviceFault>(99)), "other") << "of a driver newer than this";
}

TEST(Clutch, IsWorkedByTheButtonOfThePlacement) {
  Workspace workspace({.clutch_button = 2});
  HandState hand{.position = {0, 0, 0.1}, .buttons = 0b011U};
  EXPECT_FALSE(workspace.is_clutched(hand));
  hand.buttons = 0b100U;
  EXPECT_TRUE(workspace.is_clutched(hand));
  static const Workspace without;  // static: g++ 12 takes an empty optional for uninitialised
  EXPECT_FALSE(without.is_clutched(hand));
  EXPECT_FALSE(workspace.is_clutched({.position = {0, 0, 0.1}})) << "a device without buttons";
  EXPECT_THROW(validate(Placement{.clutch_button = 32}), Error);

  FakeDevice device;
  device.hand.buttons = 0U;
  ServoSettings settings;
  settings.placement.clutch_button = 0;
  Cycle cycle(make_method("paper"), device, settings);
  auto reader = cycle.reader();
  ServoTick record{};
  const auto run = [&](double t) {
    cycle.run({.t = t});
    EXPECT_TRUE(reader.try_pop(record));
  };
  run(1.0);
  EXPECT_EQ(record.hand, hand_present);
  device.hand.buttons = 1U;
  device.hand.position = {0.05, 0, 0};
  run(1.001);
  EXPECT_EQ(record.hand, hand_present | hand_clutched);
  EXPECT_TRUE(record.tick.hip.isZero()) << "the HIP stays";
}

}  // namespace test_device_loop
}  // namespace palpate
