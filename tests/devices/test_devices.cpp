// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <ostream>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/devices/devices.hpp"
#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/devices/mouse_device.hpp"
#include "palpate/io/devices/simulated_hand.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/cycle.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/grids.hpp"

namespace palpate {
namespace test_devices {

using test::fails_saying;

constexpr double ms = 1e-3;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(ScriptedDevice, BeginsItsPathAtTheFirstReadAndRestsAtItsEnd) {
  ScriptedDevice device(HipPath({{5.0, Vec3(0, 0, 0)}, {6.0, Vec3(0, 0, 1)}}), false);
  EXPECT_EQ(device.read(100.0).position, Vec3(0, 0, 0));
  EXPECT_NEAR(device.read(100.25).position.z(), 0.25, 1e-12);
  EXPECT_EQ(device.read(200.0).position, Vec3(0, 0, 1));
  EXPECT_TRUE(device.read(200.0).present);
}

TEST(ScriptedDevice, RepeatsItsPathIfToldTo) {
  ScriptedDevice device(HipPath({{5.0, Vec3(0, 0, 0)}, {6.0, Vec3(0, 0, 1)}}), true);
  device.read(100.0);
  EXPECT_NEAR(device.read(102.25).position.z(), 0.25, 1e-9);
  ScriptedDevice still(HipPath({{5.0, Vec3(1, 2, 3)}}), true);
  still.read(0.0);
  EXPECT_EQ(still.read(7.0).position, Vec3(1, 2, 3));
}

HipPath resting_at(const Vec3& place) { return HipPath({{0.0, place}}); }

constexpr HandModel still_hand{.tremor = 0.0};

TEST(SimulatedHand, YieldsToAForceAsASpringMassAndDamperDo) {
  SimulatedHand hand(resting_at(Vec3::Zero()), still_hand);
  hand.read(0.0);
  hand.write(3.0 * Vec3::UnitX(), 0.0);
  const double w = std::sqrt(300.0 / 0.15);
  const double decay = 8.0 / (2 * 0.15);
  const double w_d = std::sqrt(w * w - decay * decay);
  for (int i = 1; i < 500; ++i) {
    const double t = i * ms;
    const double exact =
        3.0 / 300.0 *
        (1 - std::exp(-decay * t) * (std::cos(w_d * t) + decay / w_d * std::sin(w_d * t)));
    ASSERT_NEAR(hand.read(t).position.x(), exact, 0.05e-3) << "at " << t;
  }
  EXPECT_NEAR(hand.statistics().work, 3.0 * 0.01, 3e-4) << "force times way";
}

TEST(SimulatedHand, FollowsItsPathWithTremorWithinItsBound) {
  const HipPath path({{0.0, Vec3::Zero()}, {1.0, Vec3(0, 0.1, 0)}});
  SimulatedHand hand(path, {.tremor = 0.2e-3, .seed = 3});
  double largest = 0.0;
  for (int i = 0; i < 3000; ++i) {
    const Vec3 off = hand.read(7.0 + i * ms).position - path.at(i * ms);
    largest = std::max(largest, std::abs(off.x()));
    ASSERT_LT(std::abs(off.y()), 6e-3);
  }
  EXPECT_GT(largest, 0.1e-3);
  EXPECT_LT(largest, 0.5e-3) << "resonance included";
  EXPECT_LT(hand.statistics().most_shake, 0.3e-3);
}

TEST(SimulatedHand, MovesTheSameWayForTheSameSeedAndAnotherForAnother) {
  const auto end = [](std::uint64_t seed) {
    SimulatedHand hand(resting_at(Vec3::Zero()), {.tremor = 1e-3, .seed = seed});
    Vec3 position = Vec3::Zero();
    for (int i = 0; i < 100; ++i) position = hand.read(i * ms).position;
    return position;
  };
  EXPECT_EQ(end(1), end(1));
  EXPECT_NE(end(1), end(2));
}

TEST(SimulatedHand, DoesNotRunAwayAfterAGapInTime) {
  SimulatedHand hand(HipPath({{0.0, Vec3::Zero()}, {100.0, Vec3(0, 0, 10)}}), still_hand);
  hand.read(0.0);
  EXPECT_LT(hand.read(50.0).position.z(), 0.011) << "of 50 s, 0.1 s pass";
  hand.write(Vec3(nan, 0, 0), 50.0);
  EXPECT_TRUE(hand.read(50.1).position.allFinite());
}

// Presses 10 mm into a wall at z = 0 of that stiffness and comes up again.
struct WallPress {
  explicit WallPress(double stiffness, const HandModel& model = still_hand)
      : hand(HipPath({{0.0, Vec3(0, 0, 0.01)},
                      {0.5, Vec3(0, 0, -0.01)},
                      {1.5, Vec3(0, 0, -0.01)},
                      {2.0, Vec3(0, 0, 0.01)}}),
             model) {
    for (int i = 0; i < 2500; ++i) {
      const double z = hand.read(i * ms).position.z();
      if (i == 1400) resting = z;
      hand.write(Vec3(0, 0, std::max(-stiffness * z, 0.0)), i * ms);
    }
  }
  SimulatedHand hand;
  double resting = 0.0;
};

TEST(SimulatedHand, RestsInAWallWhereTheTwoSpringsBalanceAndGainsNoEnergyFromIt) {
  const WallPress press(600.0);
  EXPECT_NEAR(press.resting, -0.01 * 300.0 / (300.0 + 600.0), 1e-6);
  EXPECT_LT(press.hand.statistics().most_work, 1e-4);
  EXPECT_LT(press.hand.statistics().most_shake, 1e-4);
}

TEST(SimulatedHand, ShowsThatAWallIsTooStiffForItsSampling) {
  // K > 2 b / T of the hand's own damping: a sampled spring feeds in more than b takes out.
  const WallPress press(40e3);
  EXPECT_GT(press.hand.statistics().most_work, 1e-3);
  EXPECT_GT(press.hand.statistics().most_shake, 2e-4);
}

TEST(SimulatedHand, RefusesAPersonWhoCannotBe) {
  const auto made = [](const HandModel& model) {
    return [model] { return SimulatedHand(resting_at(Vec3::Zero()), model).info().kind; };
  };
  EXPECT_TRUE(fails_saying(made({.mass = 0.0}), "mass", "out of range"));
  EXPECT_TRUE(fails_saying(made({.stiffness = -1.0}), "stiffness"));
  EXPECT_TRUE(fails_saying(made({.damping = nan}), "damping"));
  EXPECT_TRUE(fails_saying(made({.tremor = 1.0}), "tremor"));
}

struct Scene {
  const char* name;
  std::function<double(double, double)> height;
};

void PrintTo(const Scene& scene, std::ostream* out) {  // NOLINT: GoogleTest's name for it
  *out << scene.name;
}

class PressedScene : public testing::TestWithParam<Scene> {};

TEST_P(PressedScene, IsStableUnderASimulatedHandAndGivesItNoEnergy) {
  // Down from 30 mm, 10 mm into it for two seconds, and up again.
  const auto cloud =
      std::make_shared<PointCloud>(test::grid(1e-3, 40, GetParam().height), Vec3(0, 0, 1));
  const double surface = GetParam().height(0.0, 0.0);
  SimulatedHand hand(HipPath({{0.0, Vec3(0, 0, surface + 0.03)},
                              {2.0, Vec3(0, 0, surface + 0.03)},
                              {3.0, Vec3(0, 0, surface - 0.01)},
                              {5.0, Vec3(0, 0, surface - 0.01)},
                              {6.0, Vec3(0, 0, surface + 0.03)}}),
                     {});
  Cycle cycle(make_method("paper"), hand);
  auto reader = cycle.reader();
  ServoTick record{};
  double early = 0.0;
  double late = 0.0;
  double pressed = 0.0;
  for (int i = 0; i < 6500; ++i) {
    const double t = 50.0 + i * ms;
    if (i % 33 == 0) cycle.put_frame(cloud, t, t);
    cycle.run({.t = t});
    ASSERT_TRUE(reader.try_pop(record));
    const double shake = hand.statistics().shake;
    if (i > 3000 && i <= 4000) early = std::max(early, shake);
    if (i > 4000 && i <= 5000) late = std::max(late, shake);
    if (i == 4900) pressed = record.force.norm();
    ASSERT_EQ(record.safety & oscillation_cut, 0U);
  }
  EXPECT_GT(pressed, 0.5);
  EXPECT_LE(late, std::max(1.05 * early, 20e-6)) << "an oscillation that grows";
  // Any sampled spring gives K T / 2 times the integral of v^2 back: 3e-5 J here; 7e-3 J are
  // stored.
  EXPECT_LT(hand.statistics().most_work, 1e-4) << "[J] gained from a scene at rest";
  EXPECT_TRUE(record.force.isZero()) << "it let go";
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, PressedScene,
    testing::Values(Scene{"plane", [](double, double) { return 0.0; }},
                    Scene{"tilt", [](double x, double) { return 0.5 * x; }},
                    Scene{"wedge", [](double x, double) { return std::abs(x); }},
                    Scene{"ridge", [](double x, double) { return -0.5 * std::abs(x); }},
                    Scene{"ball",
                          [](double x, double y) {
                            return std::sqrt(std::max(0.05 * 0.05 - x * x - y * y, 0.0));
                          }},
                    Scene{"waves",
                          [](double x, double y) {
                            return 0.002 * std::sin(200 * x) * std::cos(150 * y);
                          }}),
    [](const auto& scene) { return std::string(scene.param.name); });

TEST(MouseDevice, IsHeldByNobodyUntilItIsAimed) {
  MouseDevice mouse({0.1, 0.2, 0.3});
  EXPECT_FALSE(mouse.read(0.0).present);
  EXPECT_EQ(mouse.read(1.0).position, Vec3(0.1, 0.2, 0.3));
  mouse.aim({.position = {0.1, 0.2, 0.3}});
  EXPECT_TRUE(mouse.read(1.001).present);
  mouse.aim({.position = {0.1, 0.2, 0.3}, .present = false, .clutched = true});
  EXPECT_FALSE(mouse.read(1.002).present);
  EXPECT_TRUE(mouse.read(1.003).clutched);
}

TEST(MouseDevice, IsLetGoWhenNoTargetHasComeForLong) {
  MouseDevice mouse;
  mouse.aim({.position = {0.01, 0, 0}});
  EXPECT_TRUE(mouse.read(10.0).present);
  EXPECT_TRUE(mouse.read(10.5).present);
  mouse.aim({.position = {0.01, 0, 0}});  // the same place again: it is held still
  EXPECT_TRUE(mouse.read(10.6).present);
  EXPECT_TRUE(mouse.read(11.0).present);
  EXPECT_FALSE(mouse.read(11.101).present);
  EXPECT_FALSE(mouse.read(12.0).present);
  mouse.aim({.position = {0.01, 0, 0}});
  EXPECT_TRUE(mouse.read(12.001).present);
  MouseDevice patient(Vec3::Zero(), 0.025, 1.0, "mouse:", 2.0);
  patient.aim({.position = {0.01, 0, 0}});
  EXPECT_TRUE(patient.read(0.0).present);
  EXPECT_TRUE(patient.read(1.9).present);
  EXPECT_FALSE(patient.read(2.1).present);
  EXPECT_TRUE(fails_saying(
      [] { return MouseDevice({}, 0.025, 1.0, "mouse:", 0.1).start_position(); }, "silence"));
}

TEST(MouseDevice, ReachesAFarTargetWithoutOvershootAndNeverFasterThanItMay) {
  MouseDevice mouse(Vec3::Zero(), 0.025, 1.0);
  mouse.read(0.0);
  mouse.aim({.position = {0.3, 0, 0}});
  double last = 0.0;
  for (int i = 1; i <= 1000; ++i) {
    const double x = mouse.read(i * ms).position.x();
    ASSERT_GE(x, last - 1e-12);
    ASSERT_LE(x - last, 1.0 * ms + 1e-12);
    ASSERT_LE(x, 0.3 + 1e-12);
    last = x;
  }
  EXPECT_NEAR(last, 0.3, 1e-6);
}

TEST(MouseDevice, MakesASmoothMoveOfSixtyPlacesASecond) {
  // 0.2 m/s in steps of 3.3 mm: the speed at the servo's rate must not show them.
  MouseDevice mouse(Vec3::Zero(), 0.025);
  double slowest = 1e9;
  double fastest = 0.0;
  Vec3 last = Vec3::Zero();
  double lag = 0.0;
  for (int i = 0; i < 1000; ++i) {
    const double t = i * ms;
    if (i % 16 == 0) mouse.aim({.position = {0.2 * t, 0, 0}});
    const Vec3 now = mouse.read(t).position;
    if (i > 300) {
      slowest = std::min(slowest, (now - last).norm() / ms);
      fastest = std::max(fastest, (now - last).norm() / ms);
      lag = std::max(lag, 0.2 * t - now.x());
    }
    last = now;
  }
  EXPECT_GT(slowest, 0.1);
  EXPECT_LT(fastest, 0.3);
  EXPECT_LT(lag, 0.2 * (0.025 + 0.016) + 1e-4);
}

TEST(MouseDevice, TurnsWithoutAJump) {
  MouseDevice mouse(Vec3::Zero(), 0.025);
  EXPECT_FALSE(mouse.read(0.0).orientation);
  const Eigen::Quaterniond quarter(Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitZ()));
  double left = std::numbers::pi / 2;
  for (int i = 1; i <= 600; ++i) {
    if (i % 100 == 1) mouse.aim({.orientation = quarter});
    const double now = mouse.read(i * ms).orientation.value().angularDistance(quarter);
    // 1 - exp(-w dt) of what is left, w = 2 / 25 ms, at most 4 rad/s
    ASSERT_NEAR(now, std::max(left * std::exp(-2.0 / 0.025 * ms), left - 4.0 * ms), 1e-6);
    left = now;
  }
  EXPECT_LT(left, 1e-5);
}

TEST(MouseDevice, GoesTheSameWayWhateverTheServosRate) {
  const auto place_at_50_ms = [](double dt) {
    MouseDevice mouse(Vec3::Zero(), 0.025, 10.0);
    mouse.read(0.0);
    mouse.aim({.position = {0.01, 0, 0}});
    Vec3 position = Vec3::Zero();
    for (int i = 1; i * dt <= 0.05 + 1e-9; ++i) position = mouse.read(i * dt).position;
    return position.x();
  };
  EXPECT_NEAR(place_at_50_ms(1e-3), place_at_50_ms(1e-4), 1e-12);
  const double wt = 2.0 / 0.025 * 0.05;
  EXPECT_NEAR(place_at_50_ms(1e-3), 0.01 * (1.0 - (1.0 + wt) * std::exp(-wt)), 1e-12);
}

TEST(MouseDevice, RefusesPlacesThatAreNoneAndBearsATimeThatIsNone) {
  MouseDevice mouse;
  EXPECT_TRUE(fails_saying([&] { return mouse.aim({.position = {nan, 0, 0}}), 0; }, "mouse"));
  EXPECT_TRUE(fails_saying([&] { return mouse.aim({.position = {0, 1e300, 0}}), 0; }, "mouse"));
  mouse.aim({.position = {0.01, 0, 0}});
  mouse.read(1.0);
  mouse.read(nan);
  mouse.read(0.5);
  EXPECT_TRUE(mouse.read(2.0).position.allFinite());
}

TEST(MouseDevice, CanBeAimedFromSeveralThreadsWhileItIsRead) {
  MouseDevice mouse;
  std::atomic<int> running{2};
  std::vector<std::thread> viewers;
  for (int i = 0; i < 2; ++i) {
    viewers.emplace_back([&mouse, &running, i] {
      for (int k = 0; k < 5000; ++k) mouse.aim({.position = Vec3::Constant(1e-5 * k * (i + 1))});
      --running;
    });
  }
  double t = 0.0;
  bool torn = false;
  while (running > 0) {
    const Vec3 p = mouse.read(t += ms).position;
    torn = torn || std::abs(p.x() - p.z()) > 1e-12;
  }
  for (std::thread& viewer : viewers) viewer.join();
  EXPECT_FALSE(torn);
}

TEST(OpenDevice, OpensEachKindWithItsOptions) {
  const HipPath path = resting_at({1, 2, 3});
  const auto script = open_device("script:?repeat", path);
  EXPECT_EQ(script->info().kind, "scripted path");
  EXPECT_EQ(script->read(0.0).position, Vec3(1, 2, 3));
  const auto hand = open_device("hand:?mass=0.3&tremor=0&seed=4", path);
  EXPECT_EQ(hand->read(0.0).position, Vec3(1, 2, 3));
  EXPECT_EQ(hand->info().uri, "hand:?mass=0.3&tremor=0&seed=4");
  const auto mouse = open_device("mouse:?x=10cm&z=0.5&response=40ms");
  EXPECT_EQ(mouse->read(0.0).position, Vec3(0.1, 0.0, 0.5));
  EXPECT_EQ(mouse->info().limits.max_force, 3.3);
}

class Joystick final : public Device {
 public:
  explicit Joystick(const Uri& uri) : info_{.uri = uri.text(), .kind = "joystick", .limits = {}} {}
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override { return {.position = {0, 0, 0.1}}; }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

 private:
  DeviceInfo info_;
};

TEST(OpenDevice, OpensADeviceOfAnotherProgramUnderItsOwnScheme) {
  Registry<DeviceScheme> devices = standard_devices();
  devices.add({"joystick", "a stick", [](const Uri& uri, const auto& /*path*/) {
                 return std::make_unique<Joystick>(uri);
               }});
  EXPECT_EQ(open_device("joystick:0", {}, devices)->info().kind, "joystick");
  EXPECT_EQ(open_device("mouse:", {}, devices)->info().kind, "mouse in the viewer");
  EXPECT_TRUE(fails_saying([&] { return open_device("joystik:0", {}, devices) != nullptr; },
                           "joystik", "did you mean 'joystick:'?"));
  EXPECT_TRUE(fails_saying([] { return open_device("joystick:0") != nullptr; }, "joystick:0",
                           "known here: script:, hand:, mouse:"));
}

TEST(OpenDevice, SaysWhatIsWrongWithAName) {
  const auto opening = [](std::string_view uri) {
    return [uri] { return open_device(uri) != nullptr; };
  };
  EXPECT_TRUE(fails_saying(opening("mous:"), "mous:", "did you mean 'mouse:'?"));
  EXPECT_TRUE(fails_saying(opening("tum:x"), "unknown type of device", "script:, hand:, mouse:"));
  EXPECT_TRUE(fails_saying(opening("mouse"), "scheme"));
  EXPECT_TRUE(fails_saying(opening("mouse:x"), "mouse:x", "write only mouse:"));
  EXPECT_TRUE(fails_saying(opening("script:"), "no path to follow", "script:FILE.csv"));
  EXPECT_TRUE(fails_saying(opening("script:/nonexistent.csv"), "/nonexistent.csv"));
  EXPECT_TRUE(fails_saying(opening("hand:x.csv?mas=1"), "'mas'", "did you mean 'mass'?"));
  EXPECT_TRUE(fails_saying(opening("hand:x.csv?mass=1e9"), "'mass'", "out of range"));
  EXPECT_TRUE(fails_saying(opening("mouse:?response=5m"), "'response'", "unit"));
}

}  // namespace test_devices
}  // namespace palpate
