// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/session/camera_feed.hpp"

#include "tests/session/fakes.hpp"
#include "tests/support/errors.hpp"

namespace palpate {
namespace test_camera_feed {

using test::fails_saying;

constexpr double bound = 30.0;  // [s] for a join that must succeed; never waited out

// Time that passes only where the feed waits or a scripted source takes it.
class FakeClock final : public FeedClock {
 public:
  [[nodiscard]] double now() const override { return now_; }
  [[nodiscard]] double system_start() const override { return 1.7e9; }
  void wait(std::unique_lock<std::mutex>& lock, std::condition_variable& /*changed*/,
            double t) override {
    lock.unlock();
    advance_to(t);
    lock.lock();
  }
  void advance_to(double t) {
    if (t > now_) now_ = t;
    if (now_ >= end && at_end) std::exchange(at_end, nullptr)();
  }
  // Called once, on the camera's thread, when the time has come.
  double end = 1e9;
  std::function<void()> at_end;

 private:
  std::atomic<double> now_{100.0};
};

std::shared_ptr<const Cloud> picture(std::uint16_t depth) {
  static const auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = 2, .height = 1, .fx = 2, .fy = 2, .cx = 0.5, .cy = 0.0});
  return std::make_shared<DepthImage>(rays, std::vector<std::uint16_t>{depth, 1000}, 1000.0);
}

// What one call of next() does.
struct Step {
  double at = 0.0;     // [s] after the source was opened: when its frame arrives
  double stamp = 0.0;  // [s]
  std::uint16_t depth = 1000;
  std::string error{};  // thrown instead
  double took = 0.0;    // [s] to decode a frame of a recording
};

class ScriptedSource final : public Source {
 public:
  ScriptedSource(std::shared_ptr<FakeClock> clock, std::vector<Step> steps, SourceInfo info)
      : clock_(std::move(clock)), steps_(std::move(steps)), info_(std::move(info)) {
    opened_ = clock_->now();
  }
  std::optional<Frame> next(double timeout) override {
    if (is_cancelled_) return std::nullopt;
    if (next_ == steps_.size()) {
      if (info_.live) clock_->advance_to(clock_->now() + timeout);
      return std::nullopt;
    }
    const Step& step = steps_[next_];
    if (info_.live && opened_ + step.at > clock_->now() + timeout) {
      clock_->advance_to(clock_->now() + timeout);
      return std::nullopt;
    }
    ++next_;
    clock_->advance_to(info_.live ? opened_ + step.at : clock_->now() + step.took);
    if (!step.error.empty()) throw Error("scripted camera", step.error, "mend it");
    return Frame{step.stamp, picture(step.depth)};
  }
  std::size_t skip(std::size_t count) override {
    if (!can_skip) return 0;
    const std::size_t skipped = std::min(count, steps_.size() - next_);
    next_ += skipped;
    return skipped;
  }
  void cancel() noexcept override { is_cancelled_ = true; }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }
  bool can_skip = false;

 private:
  std::shared_ptr<FakeClock> clock_;
  std::vector<Step> steps_;
  SourceInfo info_;
  double opened_ = 0.0;
  std::size_t next_ = 0;
  std::atomic<bool> is_cancelled_{false};
};

const SourceInfo recording{.uri = "scripted:", .kind = "scripted recording", .frame_rate = 30.0};
const SourceInfo live{
    .uri = "scripted:", .kind = "scripted camera", .live = true, .clock = StampClock::sensor};

// `count` frames at 30 Hz whose stamps begin at `first`, each of another depth.
std::vector<Step> frames(int count, double first, double delay = 0.0) {
  std::vector<Step> steps;
  for (int k = 0; k < count; ++k)
    steps.push_back({k / 30.0 + delay, first + k / 30.0, static_cast<std::uint16_t>(1000 + k)});
  return steps;
}

// Runs a feed on simulated time until `end` [s after the start] and keeps what it gives.
class Playing {
 public:
  struct Given {
    FedFrame fed;
    double at;  // [s]
  };
  std::shared_ptr<FakeClock> clock = std::make_shared<FakeClock>();
  std::vector<Given> given;
  std::vector<bool> stays_valid;                                   // what the status said then
  std::vector<double> opened;                                      // [s] attempts to open it again
  std::function<void(CameraFeed&)> on_given = [](CameraFeed&) {};  // after each frame
  FeedOptions options;

  [[nodiscard]] std::unique_ptr<ScriptedSource> source(std::vector<Step> steps,
                                                       const SourceInfo& info) const {
    return std::make_unique<ScriptedSource>(clock, std::move(steps), info);
  }

  // @param next  opens it the n-th time again, n from 0; may throw
  CameraStatus until(double end, std::unique_ptr<Source> first,
                     const std::function<std::unique_ptr<Source>(int)>& next = {}) {
    options.clock = clock;
    CameraFeed::Open open;
    if (next)
      open = [this, next] {
        opened.push_back(clock->now() - start);
        return next(static_cast<int>(opened.size()) - 1);
      };
    CameraFeed feed(std::move(first), options, open);
    CameraStatus status;
    clock->end = start + end;
    clock->at_end = [&] {
      status = feed.status();
      feed.request_stop();
    };
    feed.start([&](const FedFrame& fed) {
      given.push_back({fed, clock->now() - start});
      stays_valid.push_back(feed.status().stays_valid);
      on_given(feed);
    });
    EXPECT_TRUE(feed.join(bound));
    EXPECT_TRUE(feed.status().state == CameraState::stopped ||
                feed.status().state == CameraState::ended);
    if (clock->at_end) status = feed.status();
    return status;
  }
  const double start = 100.0;
};

TEST(CameraFeed, PlaysARecordingAtItsPaceWithOneOffsetAPass) {
  Playing run;
  std::vector<Step> steps = frames(30, 7.0);
  for (std::size_t k = 0; k < steps.size(); ++k)
    steps[k].stamp += 0.004 * static_cast<double>(k % 3);  // uneven
  const CameraStatus status = run.until(2.5, run.source(steps, recording),
                                        [&](int) { return run.source(steps, recording); });
  ASSERT_GE(run.given.size(), 70U);
  double before = -1.0;
  for (std::size_t k = 0; k < run.given.size(); ++k) {
    const auto& [fed, at] = run.given[k];
    const double offset = fed.frame.stamp - fed.source_stamp;
    const FedFrame& first = run.given[k / 30 * 30].fed;
    EXPECT_NEAR(offset, first.frame.stamp - first.source_stamp, 1e-9) << k;
    EXPECT_NEAR(run.start + at, fed.frame.stamp, 1e-9) << "handed over when it is due, " << k;
    EXPECT_TRUE(fed.is_new);
    EXPECT_GT(fed.frame.stamp, before);
    before = fed.frame.stamp;
  }
  EXPECT_EQ(status.text, "live");
  EXPECT_NEAR(status.rate, 30.0, 3.0);
  EXPECT_EQ(status.frames, run.given.size());
  EXPECT_EQ(status.dropped, 0U);
  EXPECT_EQ(status.opened_again, 0U) << "it was never gone";
  EXPECT_EQ(run.opened.size(), 2U);
}

TEST(CameraFeed, KeepsItsRateWhenTwoFramesComeAtOnce) {
  Playing run;
  std::vector<Step> steps = frames(30, 7.0);
  Step twin = steps.back();
  twin.at += 1e-5;
  twin.stamp += 1e-5;
  steps.push_back(twin);
  const CameraStatus status = run.until(1.0, run.source(steps, live));
  EXPECT_EQ(status.frames, 31U);
  EXPECT_NEAR(status.rate, 30.0, 4.0);
}

TEST(CameraFeed, PausesARecordingAndGoesOnAtAnotherSpeed) {
  Playing run;
  double resumed = 0.0;  // [s]
  run.on_given = [&](CameraFeed& feed) {
    if (run.given.size() == 10) feed.set_playback({.paused = true});
    if (run.given.size() == 40) {
      feed.set_playback({.speed = 0.5});
      resumed = run.clock->now() - run.start;
    }
  };
  const CameraStatus status = run.until(3.0, run.source(frames(60, 7.0), recording), [&](int) {
    return run.source(frames(60, 7.0), recording);
  });
  ASSERT_GE(run.given.size(), 60U);
  double before = -1.0;
  for (std::size_t k = 0; k < run.given.size(); ++k) {
    const auto& [fed, at] = run.given[k];
    EXPECT_GT(fed.frame.stamp, before) << k;
    EXPECT_FALSE(fed.after_jump) << k;
    const bool is_still = k >= 10 && k < 40;
    EXPECT_EQ(fed.is_new, !is_still) << k;
    EXPECT_EQ(run.stays_valid[k], is_still) << k;
    if (is_still) {
      EXPECT_EQ(fed.source_stamp, run.given[9].fed.source_stamp);
    }
    if (k > 0) {
      EXPECT_NEAR(fed.frame.stamp - before, k > 40 ? 2.0 / 30.0 : 1.0 / 30.0, 0.035) << k;
    }
    before = fed.frame.stamp;
  }
  // From the pause on, a second of the machine is half a second of the recording.
  const auto& last = run.given.back();
  EXPECT_NEAR(last.fed.source_stamp - run.given[9].fed.source_stamp, 0.5 * (last.at - resumed),
              0.04);
  EXPECT_EQ(status.place, run.given.size() - 31);
}

TEST(CameraFeed, GoesToAnotherPlaceOfARecordingAndSaysThatTimeJumps) {
  SourceInfo info = recording;
  info.frames = 60;
  for (const bool can_skip : {true, false}) {
    Playing run;
    const auto made = [&] {
      auto source = run.source(frames(60, 7.0), info);
      source->can_skip = can_skip;
      return source;
    };
    run.on_given = [&](CameraFeed& feed) {
      if (run.given.size() == 5) feed.seek(0.5);
      if (run.given.size() == 10) {
        feed.set_playback({.paused = true});
        feed.seek(0.0);
      }
      if (run.given.size() == 12) feed.set_playback({.loop = false});
      if (run.given.size() == 14) feed.seek(1.0);
    };
    const CameraStatus status = run.until(2.0, made(), [&](int) { return made(); });
    ASSERT_GT(run.given.size(), 20U);
    const auto depth_at = [&](std::size_t k) {
      return dynamic_cast<const DepthImage&>(*run.given[k].fed.frame.cloud).depth()[0];
    };
    EXPECT_EQ(depth_at(4), 1004);
    EXPECT_EQ(depth_at(5), 1030);
    EXPECT_EQ(depth_at(9), 1034);
    EXPECT_EQ(depth_at(10), 1000);
    EXPECT_EQ(depth_at(11), 1000) << "the place is shown, though it is paused";
    EXPECT_EQ(depth_at(12), 1001);
    EXPECT_EQ(depth_at(14), 1059);
    for (std::size_t k = 0; k < run.given.size(); ++k) {
      EXPECT_EQ(run.given[k].fed.after_jump, k == 5 || k == 10 || k == 14) << k;
      if (k > 0) {
        EXPECT_GT(run.given[k].fed.frame.stamp, run.given[k - 1].fed.frame.stamp) << k;
      }
      if (k > 14) {
        EXPECT_EQ(depth_at(k), 1059) << "it does not begin again";
      }
    }
    EXPECT_TRUE(status.playback.paused);
    EXPECT_EQ(status.place, 59U);
    EXPECT_NEAR(status.recorded_time, 59.0 / 30.0, 1e-9);
  }
}

TEST(CameraFeed, RefusesAPlaceOrASpeedThatCannotBe) {
  Playing run;
  CameraFeed feed(run.source(frames(3, 7.0), recording));
  EXPECT_TRUE(fails_saying([&] { feed.seek(1.1); }, "1.1"));
  EXPECT_TRUE(fails_saying([&] { feed.seek(std::nan("")); }, "position"));
  EXPECT_TRUE(fails_saying([&] { feed.set_playback({.speed = 0.0}); }, "speed': 0 is out"));
  EXPECT_TRUE(fails_saying([&] { feed.set_playback({.speed = 1e9}); }, "out of range"));
}

TEST(CameraFeed, LeavesOutFramesWhereDecodingIsTooSlowAndKeepsTheStamps) {
  Playing run;
  std::vector<Step> steps = frames(300, 0.0);
  for (Step& step : steps) step.took = 0.1;  // three times the period
  auto slow = run.source(steps, recording);
  slow->can_skip = true;
  const CameraStatus status = run.until(5.0, std::move(slow));
  ASSERT_GT(run.given.size(), 30U);
  for (const auto& [fed, at] : run.given) {
    EXPECT_NEAR(fed.frame.stamp - fed.source_stamp,
                run.given[0].fed.frame.stamp - run.given[0].fed.source_stamp, 1e-9);
    EXPECT_LT(run.start + at - fed.frame.stamp, 0.15) << "late by about its decoding at most";
  }
  EXPECT_EQ(status.slowed, 0U);
  EXPECT_GT(status.dropped, run.given.size());
}

TEST(CameraFeed, SlowsARecordingDownThatCannotLeaveFramesOut) {
  Playing run;
  std::vector<Step> steps = frames(300, 0.0);
  for (Step& step : steps) step.took = 0.1;
  const CameraStatus status = run.until(20.0, run.source(steps, recording));
  EXPECT_GT(status.slowed, 5U);
  EXPECT_LT(status.slowed, 20U);
  for (std::size_t k = 1; k < run.given.size(); ++k) {
    EXPECT_GT(run.given[k].fed.frame.stamp, run.given[k - 1].fed.frame.stamp);
    EXPECT_LT(run.start + run.given[k].at - run.given[k].fed.frame.stamp, 1.2);
  }
}

TEST(CameraFeed, ShowsARecordingOfOneFrameAgainAndAgainWithNewStamps) {
  Playing run;
  const CameraStatus status = run.until(1.0, run.source(frames(1, 4.0), recording),
                                        [&](int) { return run.source({}, recording); });
  ASSERT_GT(run.given.size(), 28U);
  for (std::size_t k = 0; k < run.given.size(); ++k) {
    EXPECT_EQ(run.given[k].fed.is_new, k == 0);
    EXPECT_NEAR(run.given[k].fed.frame.stamp, run.start + run.given[k].at, 1e-9);
    EXPECT_NEAR(run.given[k].at, static_cast<double>(k) / 30.0, 1e-6);
  }
  EXPECT_EQ(status.frames, 1U);
  EXPECT_EQ(status.kind, "scripted recording, one frame");
  EXPECT_EQ(status.text, "live");
}

TEST(CameraFeed, GoesOnAfterFramesThatCannotBeReadAndBeginsAnewAfterTenInARow) {
  Playing run;
  std::vector<Step> steps = frames(40, 0.0);
  steps[3].error = "damaged";
  for (std::size_t k = 20; k < 30; ++k) steps[k].error = "gone";
  const CameraStatus status = run.until(1.2, run.source(steps, recording),
                                        [&](int) { return run.source(steps, recording); });
  EXPECT_EQ(status.dropped, 11U + 1U);
  EXPECT_NE(status.trouble.find("damaged"), std::string::npos);
  EXPECT_EQ(status.opened_again, 1U);
  ASSERT_EQ(run.opened.size(), 1U);
  ASSERT_GT(run.given.size(), 19U);
  EXPECT_NEAR(run.given[18].fed.source_stamp, 19 / 30.0, 1e-9);
  EXPECT_EQ(run.given[19].fed.source_stamp, 0.0);
}

TEST(CameraFeed, StaysOnTheLastFrameOfARecordingThatCannotBeOpenedAgain) {
  Playing run;
  const CameraStatus status = run.until(2.0, run.source(frames(5, 0.0), recording));
  ASSERT_GT(run.given.size(), 50U);
  for (std::size_t k = 0; k < run.given.size(); ++k) {
    const auto& [fed, at] = run.given[k];
    EXPECT_EQ(fed.is_new, k < 5);
    EXPECT_FALSE(fed.after_jump);
    if (k < 5) continue;
    EXPECT_EQ(fed.source_stamp, 4 / 30.0);
    EXPECT_NEAR(run.start + at, fed.frame.stamp, 0.05) << "it is as of now";
  }
  EXPECT_EQ(status.state, CameraState::ended);
  EXPECT_EQ(status.text, "ended, its last frame stays");
  EXPECT_TRUE(status.stays_valid);
  EXPECT_EQ(status.frames, 5U);
  Playing empty;
  const CameraStatus of_nothing = empty.until(10.0, empty.source({}, recording));
  EXPECT_EQ(of_nothing.text, "ended");
  EXPECT_FALSE(of_nothing.stays_valid);
}

TEST(CameraFeed, GivesALiveCamerasStampsWithAConstantOffset) {
  Playing run;
  std::vector<Step> steps = frames(300, 5000.0, 0.02);
  for (std::size_t k = 0; k < steps.size(); ++k) {
    steps[k].stamp += 0.002 * static_cast<double>(k % 2);
    steps[k].at += 0.003 * static_cast<double>(k % 4) + 0.002 * static_cast<double>(k % 2);
  }
  const CameraStatus status = run.until(9.9, run.source(steps, live));
  ASSERT_GT(run.given.size(), 290U);
  for (const auto& [fed, at] : run.given) {
    EXPECT_NEAR(fed.frame.stamp - fed.source_stamp, run.start + 0.02 - 5000.0, 1e-6);
    EXPECT_GE(run.start + at, fed.frame.stamp);
  }
  EXPECT_EQ(status.text, "live");
  EXPECT_EQ(status.frames, run.given.size());
  EXPECT_EQ(status.dropped, 0U);
  EXPECT_NEAR(status.latency, 0.0045, 0.003) << "beyond the least, which cannot be seen";
  EXPECT_NEAR(*status.last_frame, run.given.back().fed.frame.stamp, 1e-9);
}

TEST(CameraFeed, CountsAClockThatJumpsAndSaysSo) {
  Playing run;
  std::vector<Step> steps = frames(300, 5000.0, 0.02);
  for (std::size_t k = 150; k < steps.size(); ++k) steps[k].stamp -= 15.0;
  const CameraStatus status = run.until(6.0, run.source(steps, live));
  const auto count = [&](StampProblem problem) {
    return status.stamp_problems[static_cast<std::size_t>(problem)];
  };
  EXPECT_EQ(count(StampProblem::jumped), 1U);
  EXPECT_EQ(count(StampProblem::not_increasing), 1U);
  EXPECT_EQ(count(StampProblem::from_the_future), 0U);
  EXPECT_EQ(status.text, "live; its clock jumped");
  for (std::size_t k = 1; k < run.given.size(); ++k)
    EXPECT_NEAR(run.given[k].fed.frame.stamp - run.given[k - 1].fed.frame.stamp, 1 / 30.0, 0.005);
}

TEST(CameraFeed, LooksForACameraThatIsGoneWithGrowingPauses) {
  Playing run;
  std::vector<Step> steps = frames(30, 0.0);
  for (int k = 0; k < 3; ++k) steps.push_back({1.0, 0.0, 0, "unplugged"});
  const CameraStatus status =
      run.until(25.0, run.source(steps, live), [&](int attempt) -> std::unique_ptr<Source> {
        if (attempt < 8) throw Error("scripted:", "no such device", "plug it in");
        return run.source(frames(900, 77.0), live);
      });
  ASSERT_EQ(run.opened.size(), 9U);
  const std::vector<double> pauses{0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0, 5.0};
  double t = 1.0;
  for (std::size_t k = 0; k < pauses.size(); ++k) {
    EXPECT_NEAR(run.opened[k], t += pauses[k], 0.01) << k;
  }
  EXPECT_EQ(status.opened_again, 1U);
  EXPECT_EQ(status.text, "live");
  EXPECT_TRUE(status.trouble.empty());
  EXPECT_EQ(run.given[30].fed.source_stamp, 77.0) << "its clock may have begun anew";
  EXPECT_NEAR(run.given[30].fed.frame.stamp, run.start + run.opened.back(), 0.01);
}

TEST(CameraFeed, SaysWhatIsWrongWhileItLooksForTheCamera) {
  Playing run;
  const CameraStatus status =
      run.until(3.0, run.source(std::vector<Step>(3, {0.0, 0.0, 0, "unplugged"}), live),
                [&](int) -> std::unique_ptr<Source> {
                  throw Error("scripted:", "no such device", "plug it in");
                });
  EXPECT_EQ(status.state, CameraState::searching);
  EXPECT_EQ(status.text, "looking for it again: scripted:: no such device; plug it in");
}

TEST(CameraFeed, OpensACameraAgainThatDeliversNothing) {
  Playing run;
  const CameraStatus status =
      run.until(5.0, run.source(frames(30, 0.0), live), [&](int) { return run.source({}, live); });
  ASSERT_EQ(run.opened.size(), 1U) << "5 s are left to a camera for its first frame";
  EXPECT_NEAR(run.opened[0], 29 / 30.0 + 2.0 + 0.1, 0.3);
  EXPECT_EQ(status.state, CameraState::waiting);
  EXPECT_EQ(status.text.rfind("waiting: no frame for ", 0), 0U) << status.text;
  EXPECT_NE(status.text.find("delivered nothing for"), std::string::npos) << status.text;
  Playing hesitating;
  std::vector<Step> steps = frames(60, 0.0);
  for (std::size_t k = 30; k < steps.size(); ++k) {
    steps[k].at += 1.5;
    steps[k].stamp += 1.5;
  }
  EXPECT_EQ(hesitating.until(3.0, hesitating.source(steps, live)).text, "live");
  EXPECT_GT(hesitating.given.size(), 40U);
}

// Hazard: frozen-image
TEST(CameraFeed, GivesNoFreshnessToAPictureThatStaysTheSame) {
  Playing run;
  std::vector<Step> steps = frames(300, 0.0);
  for (std::size_t k = 100; k < 200; ++k) steps[k].depth = 7;  // new stamps, one picture
  CameraStatus frozen;
  run.options.frozen_frames = 10;
  const CameraStatus status = run.until(6.0, run.source(steps, live));
  EXPECT_EQ(status.state, CameraState::frozen);
  EXPECT_EQ(status.text, "frozen: it sends the same image repeatedly");
  EXPECT_EQ(run.given.size(), 109U);
  EXPECT_NEAR(*status.last_frame, run.given.back().fed.frame.stamp, 1e-9) << "the age shows";
  Playing recovered;
  EXPECT_EQ(recovered.until(9.0, recovered.source(steps, live)).state, CameraState::live);
  EXPECT_EQ(recovered.given[109].fed.source_stamp, steps[200].stamp);
}

// A wall at 30 Hz that is 4 m away until it is 1.5 m away, as its driver says.
class WallInAnotherUnit final : public Source {
 public:
  explicit WallInAnotherUnit(std::shared_ptr<FakeClock> clock) : clock_(std::move(clock)) {
    info_.range = DepthRange{0.3, 3.0};
  }
  std::optional<Frame> next(double /*timeout*/) override {
    clock_->advance_to(clock_->now() + 1.0 / 30.0);
    ++frames_;
    return Frame{
        frames_ / 30.0,
        test::wall(static_cast<std::uint16_t>((frames_ < 75 ? 4000 : 1500) + frames_ % 2))};
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  std::shared_ptr<FakeClock> clock_;
  SourceInfo info_ = live;
  int frames_ = 0;
};

TEST(CameraFeed, DoubtsAUnitThatPutsTheSceneWhereTheCameraCannotMeasure) {
  Playing run;
  const CameraStatus doubted = run.until(2.0, std::make_unique<WallInAnotherUnit>(run.clock));
  EXPECT_EQ(doubted.state, CameraState::live);
  EXPECT_EQ(doubted.text,
            "live; 99 % of its points are outside the camera's measuring range (0.30 to 3.00 m): "
            "check the unit of its depth values");
  Playing longer;
  const CameraStatus mended = longer.until(5.0, std::make_unique<WallInAnotherUnit>(longer.clock));
  EXPECT_EQ(mended.text, "live");
}

TEST(CameraFeed, HandsTheFirstFrameOverThatWasReadBefore) {
  Playing run;
  run.options.clock = run.clock;
  CameraFeed feed(run.source(frames(2, 5.0), recording), run.options);
  ASSERT_TRUE(feed.first_frame(0.0));
  EXPECT_EQ(feed.first_frame(0.0)->stamp, 5.0) << "it is read once";
  std::vector<double> stamps;
  feed.start([&](const FedFrame& fed) {
    stamps.push_back(fed.source_stamp);
    if (stamps.size() == 2) feed.request_stop();
  });
  EXPECT_TRUE(feed.join(bound));
  EXPECT_EQ(stamps, (std::vector<double>{5.0, 5.0 + 1 / 30.0}));

  CameraFeed silent(run.source(frames(1, 5.0, 3.0), live), run.options);
  EXPECT_FALSE(silent.first_frame(1.0));
  EXPECT_TRUE(silent.first_frame(3.0));
  CameraFeed empty(run.source({}, recording), run.options);
  EXPECT_TRUE(fails_saying([&] { return empty.first_frame(1.0); }, "scripted:", "no frames"));
}

TEST(CameraFeed, OpensAUriByTheRegistryThatItIsGiven) {
  const auto clock = std::make_shared<FakeClock>();
  FeedOptions options;
  options.clock = clock;
  CameraFeed feed("synthetic:plane?size=8x6&frames=4", options);
  EXPECT_EQ(feed.info().kind, "synthetic depth camera, scene plane");
  int given = 0;
  feed.start([&](const FedFrame&) {
    if (++given == 10) feed.request_stop();  // a sink may stop its own camera
    EXPECT_LE(given, 10) << "never after the request";
  });
  EXPECT_TRUE(feed.join(bound));
  EXPECT_EQ(given, 10) << "it has begun again twice";
  EXPECT_TRUE(
      fails_saying([] { return CameraFeed("scripted:").info().kind; }, "scripted:", "known here"));
  options.schemes.add({"scripted", "scripted:, for a test", [&](const Uri& uri) {
                         SourceInfo info = recording;
                         info.uri = uri.text();
                         return std::make_unique<ScriptedSource>(clock, frames(3, 0.0), info);
                       }});
  EXPECT_EQ(CameraFeed("scripted:left", options).status().uri, "scripted:left");
}

// Random cameras: frames, errors, silences, resets, repeated stamps and pictures, ends.
TEST(CameraFeed, GivesIncreasingStampsNeverAheadOfTimeWhateverTheCameraDoes) {
  for (unsigned seed = 1; seed <= 200; ++seed) {
    std::mt19937 random(seed);
    const auto chance = [&](unsigned percent) { return random() % 100 < percent; };
    Playing run;
    run.options.frozen_frames = 3;
    const auto script = [&](bool is_live) {
      std::vector<Step> steps;
      double at = 0.0;
      double offset = 0.001 * static_cast<double>(random() % 100000);
      for (auto k = random() % 60; k > 0; --k) {
        at += chance(3) ? 3.0 : 0.033;
        if (chance(3)) offset += chance(50) ? 15.0 : -0.7;
        Step step{at + 0.001 * static_cast<double>(random() % 5), at + offset,
                  static_cast<std::uint16_t>(1000 + random() % 5)};
        if (chance(5)) step.stamp = steps.empty() ? 0.0 : steps.back().stamp;
        if (chance(2)) step.stamp = std::nan("");
        if (chance(5)) step.error = "damaged";
        if (!is_live) step.took = chance(10) ? 0.3 : 0.001;
        steps.push_back(step);
      }
      return steps;
    };
    const auto open = [&](int) -> std::unique_ptr<Source> {
      if (chance(20)) throw Error("scripted:", "no such device", "plug it in");
      const bool is_live = chance(60);
      auto source = run.source(script(is_live), is_live ? live : recording);
      source->can_skip = chance(50);
      return source;
    };
    const CameraStatus status = run.until(30.0, run.source(script(true), live), open);
    double before = 0.0;
    std::uint64_t is_new = 0;
    for (const auto& [fed, at] : run.given) {
      ASSERT_GT(fed.frame.stamp, before) << seed;
      ASSERT_LE(fed.frame.stamp, run.start + at + 1e-9) << seed;
      before = fed.frame.stamp;
      is_new += fed.is_new ? 1 : 0;
    }
    EXPECT_EQ(status.frames, is_new) << seed;
    EXPECT_FALSE(status.text.empty());
  }
}

// What a driver does whose read hangs, or only ends when it is cancelled.
class Stuck {
 public:
  void wait(bool until_cancelled) {
    std::unique_lock lock(mutex_);
    is_inside_.set_value();
    changed_.wait(lock, [&] { return is_released_ || (until_cancelled && is_cancelled_); });
  }
  void wait_until_inside() { is_inside_.get_future().wait(); }
  void wait_until_closed() { is_closed_.get_future().wait(); }
  void cancel() { set(is_cancelled_); }
  void release() { set(is_released_); }
  void close() { is_closed_.set_value(); }

 private:
  void set(bool& what) {
    {
      const std::lock_guard lock(mutex_);
      what = true;
    }
    changed_.notify_all();
  }
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_cancelled_ = false, is_released_ = false;
  std::promise<void> is_inside_, is_closed_;
};

class StuckSource final : public Source {
 public:
  StuckSource(std::shared_ptr<Stuck> stuck, bool hears_cancel)
      : stuck_(std::move(stuck)), hears_cancel_(hears_cancel) {}
  ~StuckSource() override { stuck_->close(); }
  StuckSource(const StuckSource&) = delete;
  StuckSource& operator=(const StuckSource&) = delete;
  std::optional<Frame> next(double /*timeout*/) override {
    if (given_++ == 0) return Frame{1.0, picture(1)};
    stuck_->wait(hears_cancel_);
    return Frame{2.0, picture(2)};
  }
  void cancel() noexcept override { stuck_->cancel(); }
  [[nodiscard]] const SourceInfo& info() const override { return live; }

 private:
  std::shared_ptr<Stuck> stuck_;
  bool hears_cancel_;
  int given_ = 0;
};

TEST(CameraFeed, CancelsARead) {
  const auto stuck = std::make_shared<Stuck>();
  CameraFeed feed(std::make_unique<StuckSource>(stuck, true));
  feed.start([](const FedFrame&) {});
  stuck->wait_until_inside();
  feed.request_stop();
  EXPECT_TRUE(feed.join(bound));
  EXPECT_EQ(feed.status().text, "stopped");
}

TEST(CameraFeed, LeavesAThreadThatHangsBehindAndNeverCallsTheSinkAgain) {
  const auto stuck = std::make_shared<Stuck>();
  std::atomic<int> given = 0;
  {
    CameraFeed feed(std::make_unique<StuckSource>(stuck, false));
    feed.start([&](const FedFrame&) { ++given; });
    stuck->wait_until_inside();
    feed.request_stop();
    EXPECT_FALSE(feed.join(0.001));
    EXPECT_FALSE(feed.stop(0.001));
  }
  EXPECT_EQ(given, 1);
  stuck->release();  // the driver comes back after its feed is gone
  stuck->wait_until_closed();
  EXPECT_EQ(given, 1);
}

TEST(CameraFeed, SaysThatACameraHangs) {
  const auto stuck = std::make_shared<Stuck>();
  const auto clock = std::make_shared<FakeClock>();
  FeedOptions options;
  options.clock = clock;
  CameraFeed feed(std::make_unique<StuckSource>(stuck, true), options);
  feed.start([](const FedFrame&) {});
  stuck->wait_until_inside();
  EXPECT_EQ(feed.status().text, "live");
  clock->advance_to(107.0);
  EXPECT_EQ(feed.status().text, "it hangs: no frame for 7.0 s");
  EXPECT_EQ(feed.status().state, CameraState::waiting);
}

TEST(CameraFeed, EndsAtOnceInAPauseHoweverLong) {
  FeedOptions options;
  options.first_pause = options.longest_pause = 3600.0;
  std::promise<void> tried;
  SourceInfo info = live;
  auto source = std::make_unique<ScriptedSource>(
      std::make_shared<FakeClock>(), std::vector<Step>(3, {0.0, 0.0, 0, "unplugged"}), info);
  CameraFeed feed(std::move(source), options, [] { return std::unique_ptr<Source>(); });
  feed.start([](const FedFrame&) {});
  while (feed.status().state != CameraState::searching) std::this_thread::yield();
  feed.request_stop();
  EXPECT_TRUE(feed.join(bound));
}

}  // namespace test_camera_feed
}  // namespace palpate
