// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/servo/freshness.hpp"

namespace palpate {
namespace test_freshness {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double tolerance = 0.05;

// One camera alone.
void adopt(Freshness& freshness, double stamp, double arrived) {
  const CameraFrame frame{.camera = 0, .stamp = stamp};
  freshness.adopt({&frame, 1}, arrived, tolerance);
}

// One camera alone, from 10 s on; @return the time of its last frame.
double feed(Freshness& freshness, double interval, int frames, double delay = 0.0) {
  double t = 10.0;
  for (int i = 0; i < frames; ++i) {
    t = 10.0 + i * interval;
    adopt(freshness, t - delay, t);
  }
  return t;
}

// Hazard: lost-camera
TEST(Freshness, IsInfinitelyOldBeforeTheFirstFrame) {
  EXPECT_EQ(Freshness().at(5.0).age, inf);
  EXPECT_EQ(Freshness().at(5.0).intervals, inf);
  Freshness freshness;
  adopt(freshness, nan, 5.0);
  EXPECT_EQ(freshness.at(5.0).age, inf);
}

// Hazard: lost-camera
TEST(Freshness, CountsAgeFromCaptureAndIntervalsFromArrival) {
  Freshness freshness;
  const double last = feed(freshness, 0.01, 20, 0.04);
  EXPECT_NEAR(freshness.at(last + 0.005).age, 0.045, 1e-12);
  EXPECT_NEAR(freshness.at(last + 0.005).intervals, 0.5, 1e-9);
}

// Hazard: lost-camera
TEST(Freshness, TakesACameraFor30HzUntilTwoFramesCame) {
  Freshness freshness;
  adopt(freshness, 10.0, 10.0);
  EXPECT_NEAR(freshness.at(10.1).intervals, 3.0, 1e-9);
  adopt(freshness, 10.2, 10.2);
  EXPECT_NEAR(freshness.at(10.3).intervals, 0.5, 1e-9);
}

// Hazard: lost-camera
TEST(Freshness, KnowsACamerasIntervalDespiteSkippedFramesAndBursts) {
  Freshness freshness;
  double stamp = 10.0;
  for (int i = 0; i < 60; ++i) {
    stamp += i % 4 == 1 ? 0.1 : i % 4 == 2 ? 1e-6 : 0.02;
    adopt(freshness, stamp, stamp);
    if (i < 10) continue;
    EXPECT_NEAR(freshness.at(stamp + 0.02).intervals, 1.0, 1e-9) << i;
  }
}

// Hazard: lost-camera
TEST(Freshness, LearnsNoIntervalFromAStampThatJumpedBack) {
  Freshness freshness;
  double t = feed(freshness, 0.01, 20);
  for (int i = 0; i < 20; ++i) {
    adopt(freshness, t - 0.9, t + 0.005);
    t += 0.01;
    adopt(freshness, t, t);
  }
  EXPECT_NEAR(freshness.at(t + 0.02).intervals, 2.0, 1e-9);
}

// Hazard: lost-camera
TEST(Freshness, IsThatOfTheWorstOfTwoCamerasWhicheverThatIs) {
  for (const std::size_t dead : {0U, 1U}) {
    Freshness freshness;
    std::array<CameraFrame, 2> frames = {CameraFrame{.camera = 0}, CameraFrame{.camera = 1}};
    double t = 10.0;
    for (int i = 0; i < 30; ++i) {
      t += 0.01;
      for (std::size_t camera = 0; camera < frames.size(); ++camera) {
        if (camera != dead || i < 20) frames[camera].stamp = t;
      }
      freshness.adopt(frames, t, tolerance);
    }
    EXPECT_NEAR(freshness.at(t).age, 0.1, 1e-9) << dead;
    EXPECT_NEAR(freshness.at(t).intervals, 10.0, 1e-6) << dead;
  }
}

// Hazard: lost-camera
TEST(Freshness, IsNoneAtATimeThatIsNone) {
  Freshness freshness;
  feed(freshness, 0.01, 20);
  EXPECT_FALSE(freshness.at(nan).age <= 1e9);
  EXPECT_FALSE(freshness.at(nan).intervals <= 1e9);
}

// Hazard: lost-camera
TEST(Freshness, TakesNoCameraForFasterThanAKilohertz) {
  Freshness freshness;
  double stamp = 10.0;
  for (int i = 0; i < 60; ++i) {
    stamp += 1e-6;
    adopt(freshness, stamp, stamp);
  }
  EXPECT_NEAR(freshness.at(stamp + 0.002).intervals, 2.0, 1e-6);
}

// Hazard: lost-camera
TEST(Freshness, GoesOnAfterAnInfiniteStamp) {
  Freshness freshness;
  const double last = feed(freshness, 0.01, 20);
  adopt(freshness, inf, last + 0.01);
  adopt(freshness, last + 0.02, last + 0.02);
  EXPECT_NEAR(freshness.at(last + 0.025).age, 0.005, 1e-12);
}

// Hazard: lost-camera
TEST(Freshness, AdaptsToACameraThatChangesItsRate) {
  Freshness freshness;
  double stamp = feed(freshness, 1.0 / 90.0, 50);
  for (int i = 0; i < 5; ++i) stamp += 0.2, adopt(freshness, stamp, stamp);
  EXPECT_NEAR(freshness.at(stamp + 0.2).intervals, 1.0, 1e-9);
}

// Hazard: lost-camera
TEST(Freshness, TakesNoPauseOfMoreThanASecondForARate) {
  Freshness freshness;
  for (const double stamp : {10.0, 15.0, 20.0, 25.0}) adopt(freshness, stamp, stamp);
  EXPECT_NEAR(freshness.at(25.1).intervals, 3.0, 1e-9);
}

// Hazard: lost-camera
TEST(Freshness, IsNotFooledByStampsThatRepeatRunBackwardsOrAreFromTheFuture) {
  const auto age_after = [](auto stamp_at) {
    Freshness freshness;
    const double last = feed(freshness, 0.033, 10);
    double t = last;
    for (int i = 1; i <= 20; ++i) t = last + i * 0.033, adopt(freshness, stamp_at(last, t), t);
    return freshness.at(t).age;
  };
  EXPECT_NEAR(age_after([](double, double t) { return t; }), 0.0, 1e-9);
  EXPECT_NEAR(age_after([](double last, double) { return last; }), 0.66, 1e-9);
  EXPECT_NEAR(age_after([](double last, double t) { return last - t; }), 0.66, 1e-9);
  EXPECT_NEAR(age_after([](double, double) { return nan; }), 0.66, 1e-9);
  EXPECT_NEAR(age_after([](double, double) { return inf; }), 0.66, 1e-9);
  EXPECT_NEAR(age_after([](double, double t) { return t + 0.051; }), 0.66, 1e-9);
  EXPECT_NEAR(age_after([](double, double t) { return t + 0.049; }), 0.0, 1e-9);
}

// Hazard: lost-camera
TEST(Freshness, IsNeverYoungerThanItsArrival) {
  Freshness freshness;
  adopt(freshness, 10.04, 10.0);
  EXPECT_NEAR(freshness.at(10.02).age, 0.02, 1e-9);
  EXPECT_NEAR(freshness.at(10.08).age, 0.08, 1e-9);
}

// Hazard: lost-camera
TEST(Freshness, RecoversAfterACameraStartedItsClockAnew) {
  Freshness freshness;
  const double last = feed(freshness, 0.033, 10);
  adopt(freshness, 3.0, last + 0.033);
  EXPECT_NEAR(freshness.at(last + 0.033).age, 0.033, 1e-9);
  adopt(freshness, last + 0.06, last + 0.066);
  EXPECT_NEAR(freshness.at(last + 0.066).age, 0.006, 1e-9);
}

// Several cameras at 30 Hz, one after the other, each set with the stamps of all; some die.
struct Cameras {
  explicit Cameras(std::size_t count) : frames(count) {
    for (std::size_t i = 0; i < count; ++i) frames[i].camera = i;
  }
  void run(double seconds, std::size_t alive) {
    for (const double end = t + seconds; t < end; t += 1.0 / 30.0) {
      for (std::size_t i = 0; i < alive; ++i) {
        frames[i].stamp = t + 1e-6 * static_cast<double>(i);  // due at once
        freshness.adopt(frames, t + 1e-6 * static_cast<double>(i), tolerance);
      }
      worst_intervals = std::max(worst_intervals, freshness.at(t + 1.0 / 30.0).intervals);
    }
  }

  std::vector<CameraFrame> frames;
  Freshness freshness;
  double t = 10.0;
  double worst_intervals = 0.0;
};

// Hazard: lost-camera
TEST(Freshness, ChargesNoCameraWithTheRateOfAllTogether) {
  Cameras cameras(8);
  cameras.run(1.0, 8);
  EXPECT_LT(cameras.worst_intervals, 1.01);
}

// Hazard: lost-camera
TEST(Freshness, DoesNotLetALivingCameraHideADeadOne) {
  Cameras cameras(2);
  cameras.run(1.0, 2);
  cameras.run(8.0, 1);
  EXPECT_GT(cameras.freshness.at(cameras.t).age, 8.0);
  EXPECT_GT(cameras.freshness.at(cameras.t).intervals, 200.0);
  cameras.frames.pop_back();
  cameras.run(0.1, 1);
  EXPECT_LT(cameras.freshness.at(cameras.t).age, 0.04) << "it is no longer waited for";
}

// Hazard: lost-camera
TEST(Freshness, WaitsForTheFirstFrameOfEachCamera) {
  Cameras cameras(3);
  cameras.run(1.0, 2);
  EXPECT_EQ(cameras.freshness.at(cameras.t).age, inf);
  cameras.run(0.1, 3);
  EXPECT_LT(cameras.freshness.at(cameras.t).age, 0.04);
}

// Hazard: lost-camera
TEST(Freshness, JudgesACameraThatComesBackAnew) {
  Cameras cameras(2);
  cameras.run(1.0, 2);
  const CameraFrame lost = cameras.frames.back();
  cameras.frames.pop_back();
  cameras.run(1.0, 1);
  cameras.frames.push_back({.camera = lost.camera, .stamp = nan});
  cameras.run(0.1, 1);
  EXPECT_EQ(cameras.freshness.at(cameras.t).age, inf);
}

}  // namespace test_freshness
}  // namespace palpate
