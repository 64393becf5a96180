// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/bag/messages.hpp"
#include "palpate/record/replay.hpp"

#include "tests/record/sessions.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_replay {

using test::fails_saying;
using test::press_info;
using test::record_press;
using test::TemporaryFolder;
using test::wavy_floor;

class Replay : public ::testing::TestWithParam<std::string> {};

TEST_P(Replay, GivesTheSameForcesBitForBit) {
  const TemporaryFolder folder;
  Parameters parameters;
  parameters.coupling.damping = 1.0 / 3.0;
  std::vector<ServoTick> ticks;
  {
    SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
    ticks = record_press(writer, parameters, 150, true, GetParam());
  }
  double largest = 0.0;
  for (const ServoTick& tick : ticks) largest = std::max(largest, tick.tick.force.norm());
  ASSERT_GT(largest, 0.5);  // it touched
  SessionReader reader(folder.path() / "bag");
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << text_of(report);
  EXPECT_EQ(report.ticks, 150U);
  EXPECT_EQ(report.frames, 5U);
}

INSTANTIATE_TEST_SUITE_P(Methods, Replay,
                         ::testing::Values("paper", "paper-as-printed", "fixed-step", "sight"),
                         [](const auto& each) {
                           std::string name = each.param;
                           for (char& c : name) c = c == '-' ? '_' : c;
                           return name;
                         });

TEST(ReplayOf, AToolGivesTheSameForcesAndTorquesBitForBit) {
  const TemporaryFolder folder;
  const auto tool = make_tool("box:30x20x10mm?points=400", {});
  std::vector<ServoTick> ticks;
  {
    SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
    ticks = record_press(writer, {}, 150, true, "sight", tool);
  }
  double largest = 0.0;
  for (const ServoTick& tick : ticks) largest = std::max(largest, tick.tick.torque.norm());
  ASSERT_GT(largest, 1e-3);  // [N m] it touched
  SessionReader reader(folder.path() / "bag");
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << text_of(report);
  EXPECT_EQ(report.ticks, 150U);
}

TEST(ReplayOf, FramesThatSayHowNoisyTheyAreGivesTheSameForcesBitForBit) {
  for (const auto& tool : {std::shared_ptr<const ToolShape>(), make_tool("box:30x20x10mm", {})}) {
    std::array<std::vector<ServoTick>, 2> ticks;
    for (const bool has_noise : {false, true}) {
      const TemporaryFolder folder;
      SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
      ticks[has_noise ? 1 : 0] = record_press(writer, {}, 300, true, "sight", tool, has_noise);
      SessionReader reader(folder.path() / "bag");
      const ReplayReport report = replay(reader);
      EXPECT_TRUE(report.identical()) << text_of(report);
    }
    // The forces are others than without: a replay that lost the noise would differ.
    EXPECT_GT(ticks[1].back().tick.force.norm(), 0.1);
    EXPECT_NE(ticks[0].back().tick.force, ticks[1].back().tick.force);
  }
}

// Records anew what was recorded, with some of it changed.
ReplayReport replay_changed(const std::function<bool(ServoTick&)>& change) {
  const TemporaryFolder folder;
  std::vector<ServoTick> ticks;
  {
    SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
    ticks = record_press(writer, {}, 120);
  }
  SessionReader reader(folder.path() / "bag");
  {
    SessionWriter writer(folder.path() / "changed", press_info(), 0.0);
    writer.commands({}, 0.0);
    for (const auto& [number, frame] : reader.frames()) {
      if (number == 4) continue;  // of ticks 99 to 119
      const auto cloud = reader.seen(number).cloud;
      writer.frame(number, frame.stamp, 0, cloud);
    }
    for (const auto& [number, frame] : reader.adopted()) writer.adopted(frame);
    for (ServoTick& tick : ticks) {
      if (change(tick)) writer.tick(tick);
    }
    writer.close();
  }
  SessionReader changed(folder.path() / "changed");
  return replay(changed);
}

TEST(ReplayOf, AMethodThatIsNotThereIsRefusedByName) {
  const TemporaryFolder folder;
  {
    SessionWriter writer(folder.path() / "bag", press_info(), 0.0);
    record_press(writer, {}, 40);
  }
  SessionReader reader(folder.path() / "bag");
  const MethodRegistry others("method", "", {});
  const ReplayReport report = replay(reader, {}, others);
  EXPECT_FALSE(report.identical());
  EXPECT_NE(report.broken_off.find("sight"), std::string::npos) << report.broken_off;
}

TEST(ReplayOf, AForceThatDiffersInItsLastBitIsFound) {
  const ReplayReport report = replay_changed([](ServoTick& tick) {
    if (tick.number == 42) tick.tick.force.z() = std::nextafter(tick.tick.force.z(), 1e9);
    return tick.number < 99;
  });
  EXPECT_FALSE(report.identical());
  EXPECT_EQ(report.asked.ticks, 1U);
  ASSERT_TRUE(report.asked.first);
  EXPECT_EQ(report.asked.first->tick, 42U);
  EXPECT_EQ(report.asked.first->field, "rendered_force_z");
  EXPECT_EQ(report.asked.first->recorded, std::nextafter(report.asked.first->replayed, 1e9));
  EXPECT_EQ(report.sent.ticks, 0U);
  EXPECT_TRUE(report.broken_off.empty()) << report.broken_off;
  EXPECT_EQ(report.ticks, 99U);
}

TEST(ReplayOf, TicksThatTheRecorderLostEndThere) {
  const ReplayReport report =
      replay_changed([](const ServoTick& tick) { return tick.number < 50 || tick.number > 60; });
  EXPECT_EQ(report.ticks, 50U);
  EXPECT_EQ(report.asked.ticks, 0U);
  EXPECT_FALSE(report.identical());
  EXPECT_NE(report.broken_off.find("50 to 60"), std::string::npos) << report.broken_off;
}

TEST(ReplayOf, AFrameThatTheRecorderLostEndsThere) {
  const ReplayReport report = replay_changed([](const ServoTick&) { return true; });
  EXPECT_EQ(report.ticks, 99U);
  EXPECT_FALSE(report.identical());
  EXPECT_NE(report.broken_off.find("frame 4"), std::string::npos) << report.broken_off;
}

TEST(ReplayOf, ASessionWithoutTheStateThatItBeginsWithEndsThere) {
  const ReplayReport report = replay_changed([](const ServoTick& tick) { return tick.number > 9; });
  EXPECT_EQ(report.ticks, 0U);
  EXPECT_FALSE(report.identical());
  EXPECT_NE(report.broken_off.find("in mid-session"), std::string::npos) << report.broken_off;
}

TEST(ReplayOf, AnEmptySessionIsNotCalledIdentical) {
  const TemporaryFolder folder;
  SessionWriter(folder.path() / "bag", press_info(), 0.0).close();
  SessionReader reader(folder.path() / "bag");
  EXPECT_FALSE(replay(reader).identical());
}

TEST(ReplayOf, ABagOfOthersIsRefused) {
  const TemporaryFolder folder;
  {
    BagWriter writer(folder.path() / "bag");
    writer.write(writer.topic("/a", ros::String::type), 0, ros::encode(ros::String{"b"}));
  }
  EXPECT_TRUE(fails_saying([&] { return SessionReader(folder.path() / "bag"); },
                           "not a session of palpate's", "recording:"));
}

}  // namespace test_replay
}  // namespace palpate
