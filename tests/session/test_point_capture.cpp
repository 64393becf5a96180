// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <cmath>
#include <optional>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/session/registration.hpp"

#include "tests/servo/fake_device.hpp"
#include "tests/support/errors.hpp"

namespace palpate {
namespace test_point_capture {

using test::fails_saying;

constexpr double ms = 1e-3;

// The points taken while the hand follows `path`.
std::vector<Vec3> taken(const HipPath& path, double seconds) {
  PointCapture capture;
  std::vector<Vec3> points;
  for (int i = 0; i < std::lround(seconds / ms); ++i) {
    if (const auto point = capture.add({.position = path.at(i * ms)}, i * ms))
      points.push_back(*point);
  }
  return points;
}

TEST(PointCapture, TakesAPointWhereTheTipRestsAfterItHasMoved) {
  const Vec3 a(0.1, 0, 0);
  const Vec3 b(0.1, 0.1, 0);
  const HipPath path({{0.0, Vec3::Zero()},
                      {2.0, Vec3::Zero()},  // rests at the start: no point
                      {3.0, a},
                      {6.0, a},  // for long: one point
                      {7.0, b},
                      {7.3, b},  // too short
                      {8.0, a},
                      {9.0, a}});
  const auto points = taken(path, 10.0);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_LT((points[0] - a).norm(), 1e-3);
  EXPECT_LT((points[1] - a).norm(), 1e-3);
}

TEST(PointCapture, TakesTheMeanOfARestThatTrembles) {
  PointCapture capture;
  std::optional<Vec3> point;
  capture.add({.position = Vec3::Zero()}, 0.0);
  for (int i = 1; i < 700 && !point; ++i)
    point = capture.add({.position = {0.05, 0.4e-3 * std::sin(0.2 * i), 0}}, i * ms);
  ASSERT_TRUE(point.has_value());
  EXPECT_NEAR(point->y(), 0.0, 0.05e-3);
}

TEST(PointCapture, TakesAPointAtEachPressOfAButtonAndAtNoRest) {
  PointCapture capture;
  std::vector<Vec3> points;
  for (int i = 0; i < 3000; ++i) {
    HandState hand{.position = {1e-4 * (i / 1000), 0, 0}};
    hand.buttons = i % 1000 > 700 ? 0b10U : 0U;  // no need to move between two
    if (const auto point = capture.add(hand, i * ms)) points.push_back(*point);
  }
  ASSERT_EQ(points.size(), 3U);
  EXPECT_EQ(points[2], Vec3(2e-4, 0, 0));
  PointCapture held;
  EXPECT_FALSE(held.add({.buttons = 1U}, 0.0)) << "pressed before it began";
  EXPECT_FALSE(held.add({.buttons = 1U}, ms));
}

TEST(PointCapture, TakesNothingFromADeviceThatIsAbsentOrFaulty) {
  PointCapture capture;
  capture.add({.position = Vec3::Zero()}, 0.0);
  for (int i = 1; i < 2000; ++i) {
    HandState hand{.position = {0.1, 0, 0}};
    hand.present = i % 400 != 0;  // never half a second of it
    EXPECT_FALSE(capture.add(hand, i * ms));
  }
}

TEST(CapturePoints, ReadsAScriptedDeviceOnAClockOfItsOwnWithoutForce) {
  ScriptedDevice device(HipPath({{0.0, Vec3::Zero()},
                                 {1.0, Vec3(0.1, 0, 0)},
                                 {2.0, Vec3(0.1, 0, 0)},
                                 {3.0, Vec3(0.1, 0.1, 0)}}),
                        false);
  std::vector<Vec3> told;
  const auto points =
      capture_points(device, 2, 10.0, [&](const Vec3& point) { told.push_back(point); });
  ASSERT_EQ(points.size(), 2U);
  EXPECT_LT((points[1] - Vec3(0.1, 0.1, 0)).norm(), 1e-3);
  EXPECT_EQ(told, points);
  ScriptedDevice resting(HipPath({{0.0, Vec3::Zero()}}), false);
  EXPECT_TRUE(fails_saying([&] { return capture_points(resting, 2, 10.0), 0; },
                           "script:", "0 of 2 points"));
}

// Remembers whether it was ever asked for a force.
class Watching final : public Device {
 public:
  explicit Watching(bool drives) : drives_(drives) {}
  ~Watching() override { stop(); }
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override {
    HandState hand{.position = {1e-3 * reads, 0, 0}};
    hand.buttons = ++reads % 4 == 0 ? 1U : 0U;
    if (!drives_ && reads > 40) hand.fault = DeviceFault::emergency_stop;
    return hand;
  }
  void write(const Vec3& force, double /*t*/) noexcept override {
    if (!force.isZero(0.0)) forced = true;
  }
  void enable() override { forced = true; }
  [[nodiscard]] bool drives() const override { return drives_; }
  void start(CycleCallback cycle) override {
    thread_ = std::thread([this, cycle = std::move(cycle)] {
      while (!ending_) {
        cycle();
        std::this_thread::yield();
      }
    });
  }
  void stop() noexcept override {
    ending_ = true;
    if (thread_.joinable()) thread_.join();
  }
  std::atomic<bool> forced{false};
  int reads = 0;

 private:
  DeviceInfo info_{.uri = "watching:", .kind = "watching", .limits = {}};
  bool drives_;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

TEST(CapturePoints, NeverEnablesADeviceNorSendsItAForce) {
  for (const bool drives : {false, true}) {
    Watching device(drives);
    const auto points = capture_points(device, 3, 60.0);
    ASSERT_EQ(points.size(), 3U);
    EXPECT_EQ(points[0], Vec3(3e-3, 0, 0));
    EXPECT_EQ(points[2], Vec3(11e-3, 0, 0));
    EXPECT_FALSE(device.forced);
  }
}

TEST(CapturePoints, EndsAtAFaultOfTheDevice) {
  Watching device(false);
  EXPECT_TRUE(fails_saying([&] { return capture_points(device, 1000, 60.0), 0; },
                           "watching:", "emergency stop"));
  EXPECT_FALSE(device.forced);
}

}  // namespace test_point_capture
}  // namespace palpate
