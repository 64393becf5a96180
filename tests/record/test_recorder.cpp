// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <csignal>
#include <functional>
#include <latch>
#include <memory>
#include <random>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/record/recorder.hpp"
#include "palpate/record/replay.hpp"

#include "tests/record/loop_session.hpp"
#include "tests/record/sessions.hpp"
#include "tests/servo/fake_device.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_recorder {

using test::FakeDevice;
using test::LoopSession;
using test::TemporaryFolder;
using test::wavy_floor;

class RecorderOf : public ::testing::TestWithParam<const char*> {};

TEST_P(RecorderOf, ASessionFromItsStartIsReplayedBitForBit) {
  const TemporaryFolder folder;
  LoopSession session(GetParam());
  session.record(folder.path() / "bag");
  session.run(400);  // with a stall of 20 ms in it
  session.recorder().stop();
  EXPECT_EQ(session.recorder().status().trouble, "");
  EXPECT_EQ(session.recorder().status().ticks, 400U);
  SessionReader reader(folder.path() / "bag");
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << text_of(report);
  EXPECT_EQ(report.ticks, 400U);
  double largest = 0.0;
  double sent = 0.0;
  bool reseated = false;
  for (std::size_t i = 0; i < reader.ticks(); ++i) {
    largest = std::max(largest, reader.tick(i).tick.force.norm());
    sent = std::max(sent, reader.tick(i).force.norm());
    reseated = reseated || (reader.tick(i).hand & proxy_reseated) != 0;
  }
  EXPECT_GT(largest, 1.0);
  EXPECT_GT(sent, 1.0);
  EXPECT_TRUE(reseated);
}

// A floor of three materials whose borders move, with a print that is felt, that comes and goes.
std::shared_ptr<const Cloud> floor_of_materials(int frame) {
  static const auto table = std::make_shared<const MaterialTable>([] {
    MaterialTable made{.materials = {standard_material("foam"), standard_material("sandpaper"),
                                     standard_material("metal")}};
    made.materials[1].material.texture.relief = 2e-3;
    return made;
  }());
  auto image = std::make_shared<DepthImage>(*wavy_floor(frame));
  if (frame == 7) return image;  // one without materials
  std::vector<std::uint8_t> labels;
  std::vector<std::uint8_t> brightness;
  for (std::size_t i = 0; i < image->depth().size(); ++i) {
    labels.push_back(static_cast<std::uint8_t>((i + static_cast<std::size_t>(frame / 2)) / 5 % 4));
    brightness.push_back(static_cast<std::uint8_t>(7 * i));
  }
  if (frame % 4 == 0) brightness.clear();
  image->set_materials(
      std::make_shared<LabelImage>(table, std::move(labels), std::move(brightness)));
  return image;
}

TEST_P(RecorderOf, ASessionOnMaterialsIsReplayedBitForBit) {
  for (const int before : {0, 210}) {
    const TemporaryFolder folder;
    LoopSession session(GetParam());
    session.floor = floor_of_materials;
    session.recorded(folder, before, 400);
    // As it was, and not as without materials.
    const auto camera = open_source("recording:" + (folder.path() / "bag").string());
    int with = 0;
    while (const auto frame = camera->next()) {
      const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
      if (!image.materials()) continue;
      ++with;
      ASSERT_EQ(image.materials()->table()->materials.size(), 3U);
      EXPECT_EQ(image.materials()->table()->materials[1].name, "sandpaper");
    }
    EXPECT_GE(with, 8);
  }
}

TEST_P(RecorderOf, ASessionInItsMidstIsReplayedBitForBit) {
  const TemporaryFolder folder;
  LoopSession session(GetParam());
  SessionReader reader = session.recorded(folder, 210, 300);
  const ServoTick first = reader.tick(0);
  EXPECT_NE(first.hand & method_switched, 0U);
  // It began in the midst of a touch, at whichever of its ticks the writing thread came first; the
  // hand lets go for ten ticks of each 120.
  int touching = 0;
  double largest = 0.0;
  for (std::size_t i = 0; i < 100; ++i) {
    if (reader.tick(i).tick.state != ContactState::free_motion) ++touching;
    largest = std::max(largest, reader.tick(i).tick.force.norm());
  }
  EXPECT_GT(touching, 50);
  EXPECT_GT(largest, 1.0);
}

TEST_P(RecorderOf, ASessionOfTwoCamerasIsReplayedBitForBit) {
  for (const int before : {0, 210}) {
    const TemporaryFolder folder;
    LoopSession session(GetParam());
    session.has_second = true;
    EXPECT_GE(session.recorded(folder, before, 400).frames().size(), 27U);  // each camera's
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, RecorderOf, ::testing::Values("paper", "sight"),
                         [](const auto& each) { return std::string(each.param); });

// Replays a session of which each tick was changed. @return what it found
ReplayReport replay_changed(const std::function<void(ServoTick&)>& change) {
  const TemporaryFolder folder;
  LoopSession session("paper");
  session.record(folder.path() / "bag");
  session.run(150);
  session.recorder().stop();
  SessionReader reader(folder.path() / "bag");
  {
    SessionWriter writer(folder.path() / "changed", reader.info(), 0.0);
    for (std::uint64_t i = 0; i <= reader.tick(reader.ticks() - 1).settings_number; ++i)
      writer.commands(reader.commands(i), 0.0);
    for (const auto& [number, frame] : reader.frames()) {
      const auto cloud = reader.seen(number).cloud;
      writer.frame(number, frame.stamp, 0, cloud);
      writer.adopted(reader.adopted().at(number));
    }
    for (std::size_t i = 0; i < reader.ticks(); ++i) {
      ServoTick tick = reader.tick(i);
      change(tick);
      writer.tick(tick);
    }
    writer.close();
  }
  SessionReader changed(folder.path() / "changed");
  return replay(changed);
}

TEST(ReplayOfACycle, IsIdenticalWhereNothingWasChanged) {
  const ReplayReport report = replay_changed([](ServoTick& /*tick*/) {});
  EXPECT_TRUE(report.identical()) << text_of(report);
}

TEST(ReplayOfACycle, FindsForcesThatWereNotTheOnesSent) {
  const ReplayReport report =
      replay_changed([](ServoTick& tick) { tick.force = Vec3::Constant(99.0); });
  EXPECT_FALSE(report.identical());
  EXPECT_EQ(report.asked.ticks, 0U);
  EXPECT_EQ(report.sent.ticks, 150U);
  EXPECT_GT(report.sent.largest_force, 90.0);
}

TEST(ReplayOfACycle, FindsEachChangedBitOfWhatWasSent) {
  struct Change {
    const char* field;
    std::function<void(ServoTick&)> change;
  };
  const std::vector<Change> changes = {
      {"force_y", [](ServoTick& tick) { tick.force.y() = std::nextafter(tick.force.y(), 9.0); }},
      {"gain", [](ServoTick& tick) { tick.gain = std::nextafter(tick.gain, -1.0); }},
      {"safety", [](ServoTick& tick) { tick.safety ^= 1U << 3U; }},
      {"hand", [](ServoTick& tick) { tick.hand ^= proxy_reseated; }},
      {"frame_age", [](ServoTick& tick) { tick.frame_age = std::nextafter(tick.frame_age, 9.0); }},
      {"frame_stamp", [](ServoTick& tick) { tick.frame_stamp += 1e-9; }}};
  for (const Change& each : changes) {
    const ReplayReport report = replay_changed([&](ServoTick& tick) {
      if (tick.number == 77) each.change(tick);
    });
    EXPECT_EQ(report.asked.ticks, 0U) << each.field;
    EXPECT_EQ(report.sent.ticks, 1U) << each.field;
    ASSERT_TRUE(report.sent.first) << each.field;
    EXPECT_EQ(report.sent.first->tick, 77U);
    EXPECT_EQ(report.sent.first->field, each.field);
    EXPECT_NE(report.sent.first->recorded, report.sent.first->replayed);
  }
}

TEST(ReplayOfACycle, FindsAHandThatWasElsewhere) {
  const ReplayReport report = replay_changed([](ServoTick& tick) {
    if (tick.number == 77) tick.position.z() = std::nextafter(tick.position.z(), -1.0);
  });
  ASSERT_TRUE(report.asked.first);
  EXPECT_EQ(report.asked.first->tick, 77U);
  EXPECT_EQ(report.asked.first->field, "hip_z");
}

TEST(Recorder, EndsWithTheLastTickWhoseFrameItKnows) {
  const TemporaryFolder folder;
  LoopSession session("paper");
  session.record(folder.path() / "bag");
  session.run(120);
  session.hand_no_more_frames();
  session.run(100);  // the next frame comes with tick 132
  session.recorder().stop();
  SessionReader reader(folder.path() / "bag");
  const ReplayReport report = replay(reader);
  EXPECT_TRUE(report.identical()) << report.broken_off;
  EXPECT_EQ(report.ticks, 132U);
}

TEST(Recorder, AskedToStopReturnsAtOnceAndSaysWhenItIsDone) {
  const TemporaryFolder folder;
  std::latch held_up(1);
  TickRing<ServoTick> ring(16);
  const TickRing<AdoptedFrame> frames(16);
  const TickRing<CycleState> states(16);
  Recorder recorder(folder.path() / "bag", {.version = "test"},
                    {ring.reader(), frames.reader(), states.reader()},
                    [&] { held_up.wait(); });  // a thread of the recorder's can't go on
  ring.push({});
  recorder.request_stop();
  EXPECT_FALSE(recorder.done());
  EXPECT_TRUE(recorder.status().closing);
  recorder.frame(1, 0.0, 0, wavy_floor(0));  // comes too late
  EXPECT_EQ(recorder.status().frames_waiting, 0U);
  held_up.count_down();
  recorder.stop();
  EXPECT_TRUE(recorder.done());
  EXPECT_FALSE(recorder.status().closing);
  EXPECT_EQ(recorder.status().trouble, "");
}

TEST(Recorder, CountsFramesThatItHasNoRoomForAndAReplaySaysSo) {
  const TemporaryFolder folder;
  LoopSession session("paper");
  session.record(folder.path() / "bag", {.most_frames = 0});
  session.run(200);
  session.recorder().stop();
  const Recorder::Status status = session.recorder().status();
  EXPECT_EQ(status.lost_frames, 7U);
  EXPECT_EQ(status.ticks, 200U);
  SessionReader reader(folder.path() / "bag");
  const ReplayReport report = replay(reader);
  EXPECT_EQ(report.ticks, 0U);
  EXPECT_NE(report.broken_off.find("dropped"), std::string::npos) << report.broken_off;
}

TEST(Recorder, CountsTicksThatItHasNoRoomFor) {
  const TemporaryFolder folder;
  LoopSession session("paper");
  session.record(folder.path() / "bag", {.most_ticks = 0});
  session.run(100);
  session.recorder().stop();
  EXPECT_EQ(session.recorder().status().lost_ticks, 100U);
  EXPECT_EQ(session.recorder().status().ticks, 0U);
}

// 640x480 pixels with a noise of some units, as cameras have it.
std::shared_ptr<const DepthImage> noisy_floor(unsigned seed) {
  const Intrinsics k{.width = 640, .height = 480, .fx = 600.0, .fy = 600.0, .cx = 320, .cy = 240};
  static const auto rays = std::make_shared<const ViewingRays>(k);
  std::mt19937 random(seed);
  std::vector<std::uint16_t> depth;
  for (int i = 0; i < k.width * k.height; ++i)
    depth.push_back(static_cast<std::uint16_t>(1000U + random() % 11));
  return std::make_shared<DepthImage>(rays, std::move(depth), 1000.0,
                                      Eigen::Isometry3d::Identity());
}

// Records frames faster than they can be compressed, and says on `to` how many ticks are committed
// whenever that is more; until it is killed.
[[noreturn]] void record_for_ever(const std::filesystem::path& folder, int to) {
  constexpr std::size_t frames_kept_waiting = 20;
  FakeDevice device;
  Cycle cycle(make_method(), device);
  Recorder recorder(folder, {.version = "test"}, cycle.full_reader(), {},
                    {.commit_interval = 0.02});
  recorder.commands({}, 0.0);
  const std::vector<std::shared_ptr<const Cloud>> floors{noisy_floor(1), noisy_floor(2)};
  std::uint64_t said = 0;
  for (int tick = 0;; ++tick) {
    const double now = 1e-3 * tick;
    if (tick % 33 == 0) {
      const auto& cloud = floors[static_cast<std::size_t>(tick / 33 % 2)];
      recorder.frame(cycle.put_frame(cloud, now, now), now, 0, cloud);
    }
    device.hand.position = Vec3(0.0, 0.0, 0.98 + 1e-5 * (tick % 4000));
    cycle.run({.t = now});
    Recorder::Status status = recorder.status();
    while (status.frames_waiting > frames_kept_waiting) {
      std::this_thread::yield();
      status = recorder.status();
    }
    if (status.committed_ticks <= said) continue;
    said = status.committed_ticks;
    if (::write(to, &said, sizeof said) != sizeof said) std::_Exit(1);
  }
}

// Hazard: killed-recording
TEST(Recorder, KilledAtAnyTimeLeavesASessionThatReplaysToItsLastCommit) {
  constexpr int rounds = 8;
  std::mt19937 random(5);
  for (int round = 0; round < rounds; ++round) {
    const TemporaryFolder folder;
    std::array<int, 2> pipe_ends{};
    ASSERT_EQ(pipe(pipe_ends.data()), 0);
    const pid_t child = fork();
    if (child == 0) record_for_ever(folder.path() / "bag", pipe_ends[1]);
    close(pipe_ends[1]);
    std::uint64_t committed = 0;
    for (auto commits = random() % 8 + 1; commits > 0; --commits) {
      // It commits although frames wait all the time.
      ASSERT_EQ(::read(pipe_ends[0], &committed, sizeof committed), sizeof committed);
    }
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    close(pipe_ends[0]);
    SessionReader reader(folder.path() / "bag");
    EXPECT_GE(reader.ticks(), committed);
    const ReplayReport report = replay(reader);
    EXPECT_TRUE(report.identical()) << text_of(report);
    EXPECT_EQ(report.ticks, reader.ticks());
  }
}

TEST(Recorder, EndsWithAMessageWhereItsFolderIsTakenAwayAndTheLoopGoesOn) {
  const TemporaryFolder folder;
  LoopSession session("paper");
  session.record(folder.path() / "bag");
  std::filesystem::rename(folder.path() / "bag", folder.path() / "elsewhere");
  session.run(1000);
  session.recorder().stop();
  const Recorder::Status status = session.recorder().status();
  EXPECT_TRUE(status.done);
  EXPECT_NE(status.trouble.find("metadata.yaml"), std::string::npos) << status.trouble;
  session.run(100);
}

}  // namespace test_recorder
}  // namespace palpate
