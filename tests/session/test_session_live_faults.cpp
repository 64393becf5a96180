// SPDX-License-Identifier: Apache-2.0
// Live cameras, their clocks and the disk fail while a hand presses in real time. Each tick is
// judged by its own time and by when the cameras really captured, so a slow machine changes how
// long a test takes and not what it finds.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/record/session_reader.hpp"
#include "palpate/session/session.hpp"

#include "tests/session/fakes.hpp"
#include "tests/session/slow_disk.hpp"
#include "tests/support/comes_true.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_session_live_faults {

using test::comes_true;
using test::wall;
using test::wall_depth;

enum class LiveFault {
  none,
  off,            // delivers nothing
  hung,           // a read does not return
  unplugged,      // each read throws
  frozen,         // the same image with new stamps
  slow,           // a frame in 0.6 s
  intermittent,   // frames for 0.1 s, none for 0.6 s
  stuck_clock,    // new pictures with the same stamp
  garbage_clock,  // stamps that are no numbers
  jumping_clock,  // stamps an hour ahead
};

constexpr double lost_age = 0.3;         // [s]
constexpr double frame_interval = 0.01;  // [s]

/// What a camera captured and when, for the judge; and the fault it has now.
struct CameraLog {
  std::atomic<LiveFault> fault{LiveFault::none};
  std::atomic<bool> is_cancelled{false};
  std::mutex mutex;
  std::vector<double> captured;  // [s, CLOCK_MONOTONIC] pictures that show what is there
};

class FaultyLiveCamera final : public Source {
 public:
  explicit FaultyLiveCamera(std::shared_ptr<CameraLog> log) : log_(std::move(log)) {}

  std::optional<Frame> next(double timeout) override {
    const double end = monotonic_now() + std::min(timeout, 0.1);
    for (;;) {
      pause();
      const LiveFault fault = log_->fault;
      const double now = monotonic_now();
      switch (fault) {
        case LiveFault::hung:
          while (log_->fault == LiveFault::hung && !log_->is_cancelled) pause();
          return std::nullopt;
        case LiveFault::unplugged:
          throw Error("faulty:", "it is unplugged", "plug it in");
        case LiveFault::frozen:
          return Frame{now, frozen_};
        case LiveFault::stuck_clock:
          return make(now, stuck_);
        case LiveFault::garbage_clock:
          return make(now, std::numeric_limits<double>::quiet_NaN());
        case LiveFault::jumping_clock:
          return make(now, now + 3600.0);
        case LiveFault::none:
          stuck_ = now;
          return make(now, now);
        case LiveFault::slow:
          if (now - last_ > 0.6) return make(now, now);
          break;
        case LiveFault::intermittent:
          if (std::fmod(now, 0.7) < 0.1) return make(now, now);
          break;
        case LiveFault::off:
          break;
      }
      if (now >= end || log_->is_cancelled) return std::nullopt;
    }
  }
  void cancel() noexcept override { log_->is_cancelled = true; }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  static void pause() {
    std::this_thread::sleep_for(std::chrono::duration<double>(frame_interval));
  }
  Frame make(double now, double stamp) {
    const std::lock_guard lock(log_->mutex);
    log_->captured.push_back(now);
    last_ = now;
    frozen_ = wall(static_cast<std::uint16_t>(500 + number_++ % 2));
    return {stamp, frozen_};
  }

  std::shared_ptr<CameraLog> log_;
  std::shared_ptr<const DepthImage> frozen_;
  double last_ = 0.0, stuck_ = 0.0;
  int number_ = 0;
  SourceInfo info_{.uri = "faulty:",
                   .kind = "faulty camera",
                   .frame_rate = 1.0 / frame_interval,
                   .live = true,
                   .clock = StampClock::monotonic};
};

/// Presses for 0.4 s and hovers for 0.2 s, again and again, so that it always engages anew.
class TappingDevice final : public Device {
 public:
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override {
    const double phase = std::fmod(t, 0.6);
    const double pressed = std::clamp(phase / 0.05, 0.0, 1.0) * (phase < 0.4 ? 1.0 : 0.0);
    return {.position = {0.0, 0.0, wall_depth - 0.02 + 0.025 * pressed}};
  }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

 private:
  DeviceInfo info_{.uri = "tapping:", .kind = "tapping", .limits = no_motors};
};

SessionOptions options_with(const std::vector<std::shared_ptr<CameraLog>>& logs) {
  SessionOptions options;
  for (const auto& log : logs)
    options.open_cameras.push_back(std::make_unique<FaultyLiveCamera>(log));
  options.open_devices[0] = std::make_unique<TappingDevice>();
  options.safety.fade_age = 0.1;
  options.safety.lost_age = lost_age;
  options.safety.ramp_time = 0.05;
  options.safety.stall_time = 0.1;
  return options;
}

struct Cell {
  LiveFault fault;
  bool takes_the_force;
  std::string name;
  std::string told;  // in the camera's state
};

class LiveSessionFaults : public testing::TestWithParam<std::tuple<Cell, std::size_t>> {};

// Hazard: frozen-image, lost-camera, hang
TEST_P(LiveSessionFaults, TakeTheForceOffAndGiveItBack) {
  const Cell& cell = std::get<0>(GetParam());
  const std::size_t which = std::get<1>(GetParam());
  const std::vector<std::shared_ptr<CameraLog>> logs = {std::make_shared<CameraLog>(),
                                                        std::make_shared<CameraLog>()};
  Session session(options_with(logs));
  auto reader = session.ticks();
  std::vector<ServoTick> ticks;
  const auto drain = [&] {
    for (ServoTick tick{}; reader.try_pop(tick);) ticks.push_back(tick);
  };
  const auto force_is_out = [&] {
    drain();
    return session.statistics().force_out.load();
  };
  session.start();
  ASSERT_TRUE(comes_true(force_is_out));

  const auto count_of_lost = [&] {
    constexpr std::size_t lost_bit = 10;
    static_assert(frame_lost == 1U << lost_bit);
    return session.statistics().interventions[lost_bit].load();
  };
  const std::uint64_t lost_before = count_of_lost();
  logs[which]->fault = cell.fault;
  std::string text;
  EXPECT_TRUE(comes_true([&] {
    drain();
    text = session.state().cameras[which].text;
    const bool is_told = text.find(cell.told) != std::string::npos;
    return is_told && (!cell.takes_the_force || count_of_lost() > lost_before);
  })) << "'"
      << cell.told << "' is not in: " << text;
  if (!cell.takes_the_force) {
    EXPECT_TRUE(comes_true([&] { return !force_is_out(); }));
    EXPECT_TRUE(comes_true(force_is_out)) << "the pictures are good";
  }
  logs[which]->fault = LiveFault::none;
  // The fault may be over before the last force with it was seen to go.
  EXPECT_TRUE(comes_true([&] {
    drain();
    return session.state().cameras[which].text.starts_with("live");
  }));
  EXPECT_TRUE(comes_true([&] { return !force_is_out(); }));
  EXPECT_TRUE(comes_true(force_is_out)) << "all is well again";
  session.stop();
  drain();

  // [s] by which a frame may be handed over before its capture was noted, and placed anew where
  // its stamp is not believed.
  constexpr double slack = 0.05;
  const double longest = lost_age + slack;
  double before = 0.0;
  for (const ServoTick& tick : ticks) {
    const double force = tick.force.norm();
    ASSERT_TRUE(tick.force.allFinite());
    if ((tick.safety & frame_late) != 0) {
      ASSERT_LE(force, before) << "it grows while a camera is late";
    }
    before = force;
    if (force == 0.0) continue;
    for (const auto& log : logs) {
      const std::lock_guard lock(log->mutex);
      const auto next = std::upper_bound(log->captured.begin(), log->captured.end(), tick.tick.t);
      ASSERT_NE(next, log->captured.begin());
      // A picture that is frozen is noticed at its tenth frame.
      const double frozen = cell.fault == LiveFault::frozen ? 20.0 * frame_interval + 1.0 : 0.0;
      ASSERT_LE(tick.tick.t - *std::prev(next), longest + frozen)
          << force << " N on an old picture";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Cameras, LiveSessionFaults,
    testing::Combine(testing::Values(Cell{LiveFault::off, true, "Off", "no frame"},
                                     Cell{LiveFault::hung, true, "Hung", "it hangs"},
                                     Cell{LiveFault::unplugged, true, "Unplugged", "plug it in"},
                                     Cell{LiveFault::frozen, true, "Frozen", "the same image"},
                                     Cell{LiveFault::slow, true, "Slow", ""},
                                     Cell{LiveFault::intermittent, true, "Intermittent", ""},
                                     Cell{LiveFault::stuck_clock, false, "StuckClock",
                                          "do not increase"},
                                     Cell{LiveFault::garbage_clock, false, "GarbageClock", ";"},
                                     Cell{LiveFault::jumping_clock, false, "JumpingClock", ";"}),
                     testing::Values(0U, 1U)),
    [](const auto& cell) {
      return std::get<0>(cell.param).name +
             (std::get<1>(cell.param) == 0 ? "FirstCamera" : "SecondCamera");
    });

// Hazard: session-stops
TEST(LiveSession, GoesOnAndSaysSoWhereTheDiskOfARecordingFails) {
  const test::TemporaryFolder folder;
  const auto log = std::make_shared<CameraLog>();
  Session session(options_with({log}));
  const auto force_is_out = [&] { return session.statistics().force_out.load(); };
  session.start();
  ASSERT_TRUE(comes_true(force_is_out));
  session.start_recording((folder.path() / "bag").string());
  ASSERT_TRUE(comes_true([&] { return session.state().recording.on; }));
  std::filesystem::rename(folder.path() / "bag", folder.path() / "elsewhere");
  session.stop_recording();
  EXPECT_TRUE(comes_true([&] { return session.state().recording.failed; }));
  EXPECT_NE(session.state().recording.message.find("metadata.yaml"), std::string::npos)
      << session.state().recording.message;
  const std::uint64_t ticks = session.statistics().ticks;
  EXPECT_TRUE(comes_true([&] { return !force_is_out(); }));
  EXPECT_TRUE(comes_true(force_is_out));
  EXPECT_GT(session.statistics().ticks, ticks);
}

// Hazard: session-stops, hanging-disk
TEST(LiveSession, StopsAndSaysWhatIsNotWrittenWhereTheDiskOfARecordingHangs) {
  const test::TemporaryFolder folder;
  const std::filesystem::path bag = folder.path() / "bag";
  test::SlowDisk disk;
  disk.delay = std::chrono::milliseconds(2);  // 2 MB/s
  SessionOptions options = options_with({std::make_shared<CameraLog>()});
  options.record = bag.string();
  options.record_patience = 0.3;
  {
    Session session(std::move(options));
    const auto force_is_out = [&] { return session.statistics().force_out.load(); };
    session.start();
    for (int i = 0; i < 2; ++i) {
      ASSERT_TRUE(comes_true(force_is_out)) << "on a slow disk and on one that hangs";
      ASSERT_TRUE(comes_true([&] { return !force_is_out(); }));
      EXPECT_FALSE(session.state().recording.failed);
      disk.hangs = true;
      ASSERT_TRUE(comes_true([&] { return disk.is_hanging.load(); }));
    }
    session.stop();
    const RecordingState recording = session.state().recording;
    EXPECT_TRUE(recording.failed);
    EXPECT_FALSE(recording.on || recording.closing);
    for (const std::string_view part : {bag.c_str(), "the disk hangs", "are not written"})
      EXPECT_NE(recording.message.find(part), std::string::npos) << recording.message;
  }
  // When the disk goes on, all of it is written although the session is gone.
  disk.hangs = false;
  EXPECT_TRUE(comes_true([&] { return BagReader(bag).check().closed; }));
  EXPECT_GT(SessionReader(bag).ticks(), 100U);
}

}  // namespace test_session_live_faults
}  // namespace palpate
