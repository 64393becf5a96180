// SPDX-License-Identifier: Apache-2.0
// Several hands in one session: each as it would be alone, but none with a force while another is
// in trouble.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/devices/mouse_device.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/record/replay.hpp"
#include "palpate/record/session_reader.hpp"
#include "palpate/session/session.hpp"

#include "tests/session/fakes.hpp"
#include "tests/support/comes_true.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/patient.hpp"
#include "tests/support/sanitized.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_session_hands {

using test::comes_true;
using test::fails_saying;
using test::MadeSource;
using test::wall;
using test::wall_depth;
using test::wall_source;

// Comes down on the wall at `x` and stays 5 mm behind it.
HipPath pressing(double x, double at) {
  const Vec3 hover(x, 0.0, wall_depth - 0.05);
  const Vec3 pressed(x, 0.0, wall_depth + 0.005);
  return HipPath({{0.0, hover}, {at, hover}, {at + 0.1, pressed}});
}

// A hand that follows such a path, of which a test says when it is not well.
class TroubledHand final : public Device {
 public:
  using Trouble = std::function<void(double t, HandState&)>;
  TroubledHand(const HipPath& path, Trouble trouble)
      : hand_(path, false), trouble_(std::move(trouble)) {}
  [[nodiscard]] const DeviceInfo& info() const override { return hand_.info(); }
  HandState read(double t) noexcept override {
    HandState state = hand_.read(t);
    trouble_(t, state);
    return state;
  }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

 private:
  ScriptedDevice hand_;
  Trouble trouble_;
};

std::unique_ptr<Device> first_device() {
  return std::make_unique<ScriptedDevice>(pressing(-0.02, 0.4), false);
}
std::unique_ptr<Device> second_device() {
  return std::make_unique<ScriptedDevice>(pressing(0.02, 0.7), false);
}

SessionOptions on_the_wall(std::unique_ptr<Device> device) {
  SessionOptions options;
  options.open_cameras.push_back(wall_source());
  options.open_devices[0] = std::move(device);
  options.pace = Pace::free_running;
  return options;
}

struct Played {
  std::vector<ServoTick> first, second;
  SessionState state;
};

Played play(SessionOptions options, double duration) {
  Played played;
  options.on_tick = [&](std::size_t hand, const ServoTick& tick) {
    (hand == 0 ? played.first : played.second).push_back(tick);
  };
  Session session(std::move(options));
  session.run(duration);
  played.state = session.state();
  return played;
}

SessionOptions with_two(std::unique_ptr<Device> first, std::unique_ptr<Device> second) {
  SessionOptions options = on_the_wall(std::move(first));
  options.open_devices.push_back(std::move(second));
  options.hands.resize(2);
  return options;
}

void expect_the_same(const std::vector<ServoTick>& a, const std::vector<ServoTick>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].force, b[i].force) << "tick " << i;
    ASSERT_EQ(a[i].tick.proxy, b[i].tick.proxy) << "tick " << i;
    ASSERT_EQ(a[i].safety, b[i].safety) << "tick " << i;
    ASSERT_EQ(a[i].hand, b[i].hand) << "tick " << i;
  }
}

double force_at(const std::vector<ServoTick>& ticks, double t) {
  return ticks.at(static_cast<std::size_t>(std::lround(1e3 * t))).force.norm();
}

TEST(SessionHands, EachFeelsWhatItWouldFeelAlone) {
  const Played both = play(with_two(first_device(), second_device()), 3.0);
  EXPECT_GT(force_at(both.first, 2.9), 2.0);
  EXPECT_GT(force_at(both.second, 2.9), 2.0);
  expect_the_same(both.first, play(on_the_wall(first_device()), 3.0).first);
  expect_the_same(both.second, play(on_the_wall(second_device()), 3.0).first);
  ASSERT_EQ(both.state.hands.size(), 2U);
  EXPECT_EQ(both.state.hands[1].name, "hand_2");
  EXPECT_EQ(both.state.hands[1].summary.ticks, 3000U);
  EXPECT_GT(both.state.hands[1].summary.largest_sent, 2.0);
}

// Hazard: another-hand
TEST(SessionHands, LoseTheirForceTogetherAndEngageAnew) {
  struct Case {
    const char* name;
    TroubledHand::Trouble trouble;
  };
  const auto at = [](double t) { return t > 2.0 && t < 2.3; };
  const std::vector<Case> cases{
      {"a fault of the device",
       [at](double t, HandState& hand) {
         if (at(t)) hand.fault = DeviceFault::overheated;
       }},
      {"a hand that is too fast",
       [at](double t, HandState& hand) {
         if (at(t)) hand.position.y() = 3.0 * (t - 2.0);
       }},
      {"a position that is no number",
       [at](double t, HandState& hand) {
         if (at(t)) hand.position.x() = std::numeric_limits<double>::quiet_NaN();
       }},
  };
  for (const Case& each : cases) {
    SCOPED_TRACE(each.name);
    const auto troubled = [&] {
      return std::make_unique<TroubledHand>(pressing(0.02, 0.4), each.trouble);
    };
    for (const bool first_is_troubled : {true, false}) {
      const Played both = first_is_troubled ? play(with_two(troubled(), first_device()), 4.0)
                                            : play(with_two(first_device(), troubled()), 4.0);
      const std::vector<ServoTick>& well = first_is_troubled ? both.second : both.first;
      EXPECT_GT(force_at(well, 1.9), 2.0);
      // 3 N shrink within 2 ms; a hand is too fast once its speed has been seen for some ms.
      EXPECT_EQ(force_at(well, 2.05), 0.0);
      EXPECT_EQ(fault_of(well.at(2050).hand), DeviceFault::another_hand);
      // This hand still presses, so nothing may come back at once when the other one is well.
      EXPECT_EQ(force_at(well, 3.9), 0.0);
      EXPECT_EQ(well.back().safety & disengaged, disengaged);
    }
  }
}

TEST(SessionHands, AreHeldUpByNobodyWhoIsMerelyAway) {
  const auto away = std::make_shared<TroubledHand::Trouble>(
      [](double t, HandState& hand) { hand.present = t < 1.5; });
  const Played both = play(
      with_two(first_device(), std::make_unique<TroubledHand>(pressing(0.02, 0.4), *away)), 3.0);
  EXPECT_EQ(force_at(both.second, 2.9), 0.0);
  expect_the_same(both.first, play(on_the_wall(first_device()), 3.0).first);
}

TEST(SessionHands, AreRecordedAndReplayedBitForBit) {
  const test::TemporaryFolder folder;
  const std::filesystem::path bag = folder.path() / "bag";
  SessionOptions options =
      with_two(first_device(),
               std::make_unique<TroubledHand>(pressing(0.02, 0.4), [](double t, HandState& hand) {
                 if (t > 1.5 && t < 1.6) hand.fault = DeviceFault::emergency_stop;
               }));
  options.hands[1].name = "left";
  options.record = bag.string();
  const Played both = play(std::move(options), 2.0);
  EXPECT_FALSE(both.state.recording.failed) << both.state.recording.message;
  EXPECT_NE(both.state.recording.message.find("left: 2000 ticks"), std::string::npos)
      << both.state.recording.message;

  SessionReader first(bag);
  EXPECT_EQ(first.info().hand, "hand_1");
  ASSERT_EQ(first.info().more_hands, std::vector<std::string>{"left"});
  SessionReader second(hand_folder(bag, "left"));
  for (SessionReader* reader : {&first, &second}) {
    ASSERT_EQ(reader->ticks(), 2000U);
    const ReplayReport report = replay(*reader);
    EXPECT_TRUE(report.identical()) << report.broken_off;
    EXPECT_EQ(report.frames, 60U);
  }
  EXPECT_EQ(fault_of(first.tick(1550).hand), DeviceFault::another_hand);
  EXPECT_EQ(first.tick(1550).force, both.first[1550].force);
  EXPECT_EQ(second.tick(1550).force, both.second[1550].force);
  // As a user may write it.
  EXPECT_EQ(SessionReader(bag.string() + "/left/").frames().size(), 60U);

  std::filesystem::rename(bag / "left", folder.path() / "left");
  EXPECT_TRUE(fails_saying([&] { const SessionReader reader(folder.path() / "left"); },
                           "first hand", "leave it in the folder"));
}

TEST(SessionHands, HavePlacesOfTheirOwn) {
  SessionOptions options = with_two(first_device(), second_device());
  // Half a metre farther up, so that it never reaches the wall.
  options.hands[1].placement.world_from_device.translation().z() = -0.5;
  Session session(std::move(options));
  std::size_t ticks = 0;
  session.run(1.5, [&](const ServoTick& /*tick*/) { ++ticks; });
  EXPECT_EQ(ticks, 1500U);
  const SessionState state = session.state();
  EXPECT_GT(state.hands[0].summary.largest_sent, 0.5);
  EXPECT_EQ(state.hands[1].summary.contact_ticks, 0U);

  Placement placement;
  placement.workspace_scale = 2.0;
  session.place(1, placement);
  EXPECT_EQ(session.state().hands[1].placement.workspace_scale, 2.0);
  EXPECT_EQ(session.settings().placement.workspace_scale, 1.0);
  session.change([](ServoSettings& settings) { settings.safety.max_force = 1.0; });
  EXPECT_EQ(session.state().hands[1].placement.workspace_scale, 2.0) << "and stay";
  placement.workspace_scale = -1.0;
  EXPECT_TRUE(fails_saying([&] { session.place(1, placement); }, "scale", ""));
  EXPECT_THROW(session.place(2, Placement()), std::out_of_range);
  EXPECT_THROW(static_cast<void>(session.ticks(2)), std::out_of_range);
}

TEST(SessionHands, AreRefusedWithTheReason) {
  const auto two_named = [](const std::string& name, const std::string& other) {
    SessionOptions options = with_two(first_device(), second_device());
    options.hands[1].name = name;
    options.hands.push_back({.name = other});
    options.open_devices.push_back(second_device());
    const Session session(std::move(options));
  };
  EXPECT_NO_THROW(two_named("left", ""));
  EXPECT_TRUE(fails_saying([&] { two_named("left", "left"); }, "'left'", "two hands"));
  EXPECT_TRUE(fails_saying([&] { two_named("hand_1", ""); }, "'hand_1'", "two hands"));
  for (const char* name : {"Left", "2nd", "../left", "a b", "_x"})
    EXPECT_TRUE(fails_saying([&] { two_named(name, ""); }, "small letters", name));
  EXPECT_TRUE(fails_saying(
      [] {
        SessionOptions options = on_the_wall(first_device());
        for (int i = 0; i < 8; ++i) options.open_devices.push_back(second_device());
        const Session session(std::move(options));
      },
      "9", "at most 8"));
  EXPECT_TRUE(fails_saying(
      [] {
        SessionOptions options = on_the_wall(nullptr);
        options.hands[0].device = "mouse:";
        options.hands.push_back({.device = "mouse:"});
        const Session session(std::move(options));
      },
      "mouse:", "one of them"));
}

TEST(SessionHands, OfAGripperPushEachOtherApart) {
  // A plate of 20 mm, seen from both sides.
  constexpr double thickness = 0.02;
  SessionOptions options = on_the_wall(std::make_unique<ScriptedDevice>(
      HipPath({{0.0, {0, 0, wall_depth - 0.03}}, {2.0, {0, 0, wall_depth + 0.004}}}), false));
  Eigen::Isometry3d opposite = Eigen::Isometry3d::Identity();
  opposite.linear() = Eigen::AngleAxisd(M_PI, Vec3::UnitX()).toRotationMatrix();
  opposite.translation().z() = 2.0 * wall_depth + thickness;
  options.open_cameras.push_back(wall_source());
  options.cameras = {{}, {.world_from_camera = opposite}};
  const double back = wall_depth + thickness;
  options.open_devices.push_back(std::make_unique<ScriptedDevice>(
      HipPath({{0.0, {0, 0, back + 0.03}}, {2.0, {0, 0, back - 0.004}}}), false));
  const Played fingers = play(std::move(options), 4.0);
  const Vec3 one = fingers.first.back().force;
  const Vec3 other = fingers.second.back().force;
  EXPECT_NEAR(one.z(), -2.4, 0.1) << "600 N/m times 4 mm";
  EXPECT_NEAR(other.z(), 2.4, 0.1);
}

// In real time.

// Presses and hovers in turn, hangs in `read` while it is told to, and keeps what
// was written last.
class LiveHand final : public Device {
 public:
  struct Told {
    std::atomic<bool> hangs{false}, is_hanging{false};
    std::atomic<bool> force_out{false}, is_enabled{false};
  };
  explicit LiveHand(std::shared_ptr<Told> told) : told_(std::move(told)) {}
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override {
    while (told_->hangs) {
      told_->is_hanging = true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    told_->is_hanging = false;
    // 50 mm before the wall for 50 reads, 5 mm behind it for 400, and 100 to go there and back.
    const int phase = ++reads_ % 650;
    const double share =
        std::clamp(std::min((phase - 50) / 100.0, (650 - phase) / 100.0), 0.0, 1.0);
    return {.position = {0.0, 0.0, wall_depth - 0.05 + 0.055 * share}};
  }
  void write(const Vec3& force, double /*t*/) noexcept override {
    told_->force_out = told_->is_enabled && !force.isZero(0.0);
  }
  void enable() override { told_->is_enabled = true; }
  void disable() noexcept override {
    told_->is_enabled = false;
    told_->force_out = false;
  }

 private:
  std::shared_ptr<Told> told_;
  int reads_ = 0;
  DeviceInfo info_{.uri = "live:", .kind = "live", .limits = no_motors};
};

std::unique_ptr<Source> living_wall() {
  return std::make_unique<MadeSource>(
      [](int k) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return Frame{monotonic_now(), wall(static_cast<std::uint16_t>(500 + k % 2))};
      },
      SourceInfo{.uri = "live:",
                 .kind = "live camera",
                 .frame_rate = 100.0,
                 .live = true,
                 .clock = StampClock::monotonic});
}

// Patient with a busy machine.
SessionOptions live_with_two(const std::shared_ptr<LiveHand::Told>& one,
                             const std::shared_ptr<LiveHand::Told>& other) {
  SessionOptions options;
  options.open_cameras.push_back(living_wall());
  options.open_devices[0] = std::make_unique<LiveHand>(one);
  options.open_devices.push_back(std::make_unique<LiveHand>(other));
  options.safety = test::patient();
  return options;
}

// Hazard: another-hand
TEST(LiveSessionHands, LetGoWhereOneOfThemHangsAndAllEndTogether) {
  const auto one = std::make_shared<LiveHand::Told>();
  const auto other = std::make_shared<LiveHand::Told>();
  Session session(live_with_two(one, other));
  session.start();
  ASSERT_TRUE(comes_true([&] { return one->force_out && other->force_out; }));
  other->hangs = true;
  ASSERT_TRUE(comes_true([&] { return other->is_hanging.load(); }));
  const auto sees_it = [&] {
    return fault_of(session.statistics(0).hand) == DeviceFault::another_hand;
  };
  EXPECT_TRUE(comes_true(sees_it));
  EXPECT_TRUE(comes_true([&] { return !one->force_out && !other->force_out; }));
  EXPECT_TRUE(comes_true([&] {
    return session.state().hands[0].trouble == describe(DeviceFault::another_hand);
  })) << session.state().hands[0].trouble;
  EXPECT_TRUE(
      comes_true([&] { return session.state().hands[1].trouble.starts_with("no tick for"); }));
  for (int i = 0; i < 50; ++i) {
    ASSERT_FALSE(one->force_out);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  other->hangs = false;
  EXPECT_TRUE(comes_true([&] { return one->force_out && other->force_out; })) << "both engage anew";
  // Neither waits for the other's end.
  other->hangs = true;
  ASSERT_TRUE(comes_true([&] { return other->is_hanging.load(); }));
  session.stop();
  EXPECT_FALSE(one->is_enabled);
  EXPECT_FALSE(other->is_enabled);
  EXPECT_FALSE(one->force_out);
  other->hangs = false;
  EXPECT_TRUE(comes_true([&] { return !other->is_hanging; }));
  EXPECT_FALSE(other->force_out);
}

TEST(LiveSessionHands, AreRecordedFromTheMiddleOfASession) {
  const test::TemporaryFolder folder;
  const std::filesystem::path bag = folder.path() / "bag";
  const auto one = std::make_shared<LiveHand::Told>();
  const auto other = std::make_shared<LiveHand::Told>();
  {
    Session session(live_with_two(one, other));
    session.start();
    ASSERT_TRUE(comes_true([&] { return one->force_out && other->force_out; }));
    session.start_recording(bag.string());
    EXPECT_TRUE(fails_saying([&] { session.start_recording(bag.string()); }, "already", "stop"));
    const std::uint64_t now = session.statistics(1).ticks;
    session.change([](ServoSettings& settings) { settings.safety.max_force = 1.0; });
    ASSERT_TRUE(comes_true([&] { return session.statistics(1).ticks > now + 600; }));
    session.stop();
    EXPECT_FALSE(session.state().recording.failed) << session.state().recording.message;
  }
  for (const std::filesystem::path& path : {bag, hand_folder(bag, "hand_2")}) {
    SessionReader reader(path);
    EXPECT_GT(reader.ticks(), 300U);
    const ReplayReport report = replay(reader);
    EXPECT_TRUE(report.identical()) << path << ": " << report.broken_off;
  }
}

}  // namespace test_session_hands
}  // namespace palpate
