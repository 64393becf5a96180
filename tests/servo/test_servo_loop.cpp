// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <ctime>
#include <memory>
#include <set>
#include <thread>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/servo_loop.hpp"

#include "tests/servo/fake_device.hpp"
#include "tests/support/comes_true.hpp"
#include "tests/support/grids.hpp"

namespace palpate {
namespace test_servo_loop {

using test::FakeDevice;

double thread_cpu_time() {  // [s]
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

TEST(Histogram, GivesQuantilesWithinItsBucketsWidth) {
  Histogram histogram;
  EXPECT_EQ(histogram.quantile(0.5), 0U);
  for (std::uint64_t ns = 1; ns <= 100'000; ++ns) histogram.add(ns);
  EXPECT_EQ(histogram.count(), 100'000U);
  EXPECT_EQ(histogram.max(), 100'000U);
  for (const double q : {0.001, 0.5, 0.99, 0.9999}) {
    const auto value = static_cast<double>(histogram.quantile(q));
    EXPECT_GE(value, q * 1e5) << q;
    EXPECT_LE(value, q * 1e5 * 1.033) << q;
  }
  EXPECT_EQ(histogram.quantile(1.0), 100'000U);
}

TEST(Histogram, TakesZeroAndTheLongestTimes) {
  Histogram histogram;
  histogram.add(0);
  EXPECT_EQ(histogram.quantile(1.0), 0U);
  histogram.add(~0ULL);
  EXPECT_EQ(histogram.max(), ~0ULL);
  EXPECT_GT(histogram.quantile(1.0), 3'600'000'000'000U);
}

TEST(PeriodicThread, RefusesARateOutOfRange) {
  const auto nothing = [](const Wake&) {};
  EXPECT_THROW(PeriodicThread(0.0, {}, nothing), Error);
  EXPECT_THROW(PeriodicThread(1e6, {}, nothing), Error);
  FakeDevice device;
  EXPECT_THROW(ServoLoop(make_method("paper"), device, {}, {.rate = 100.0}), Error);
  EXPECT_THROW(ServoLoop(make_method("paper"), device, {}, {.rate = 20'000.0}), Error);
}

TEST(PeriodicThread, SaysWhatTheSystemGrantedAndHowToGetTheRest) {
  std::atomic<int> cycles{0};
  PeriodicThread thread(1000.0, {}, [&](const Wake&) { ++cycles; });
  const RealtimeReport& report = thread.realtime();
  const int refused = !report.fifo + !report.locked + (report.core < 0) + !report.awake;
  EXPECT_EQ(report.advice.size(), static_cast<std::size_t>(refused));
  EXPECT_EQ(report.priority > 0, report.fifo);
  EXPECT_TRUE(test::comes_true([&] { return cycles >= 3; }));
}

TEST(PeriodicThread, SkipsDeadlinesThatPassedAndDoesNotMakeThemUp) {
  std::atomic<int> cycles{0};
  double last = 0.0;
  bool was_long = false;
  int bursts = 0;
  PeriodicThread thread(1000.0, {.enabled = false}, [&](const Wake& wake) {
    if (was_long && wake.t - last < 0.02) ++bursts;
    was_long = cycles % 5 == 0;
    if (was_long) {  // works for 20 periods
      const double cpu = thread_cpu_time();
      while (monotonic_now() < wake.t + 0.02 || thread_cpu_time() < cpu + 2e-3) {
      }
    }
    last = wake.t;
    ++cycles;
  });
  // One that was woken late counts as that only.
  EXPECT_TRUE(test::comes_true([&] {
    const Timing& timing = thread.timing();
    return cycles >= 10 && timing.late_by_compute + timing.late_by_interruption >= 1U;
  }));
  thread.stop();
  EXPECT_EQ(bursts, 0);
  EXPECT_GE(thread.timing().late_ticks, 1U);
  EXPECT_EQ(thread.timing().compute.count(), static_cast<std::uint64_t>(cycles.load()));
  EXPECT_GE(thread.timing().compute.max(), 1'000'000U) << "by the thread's own CPU clock";
}

TEST(Timing, CountsLateTicksByTheirCause) {
  Timing timing;
  timing.add_late(true, 10, 10);
  timing.add_late(false, 9, 10);
  timing.add_late(false, 1, 10);
  timing.add_late(false, 2, 10);
  EXPECT_EQ(timing.late_ticks, 4U);
  EXPECT_EQ(timing.late_by_compute, 1U);
  EXPECT_EQ(timing.late_by_interruption, 2U);
}

// Hazard: session-stops
TEST(ServoLoop, TicksWhileACameraFloodsItAndViewersComeAndGo) {
  FakeDevice device;
  device.hand.position = {0, 0, 0.01};
  ServoLoop loop(make_method("paper"), device);
  auto recorder = loop.cycle().reader();
  loop.start();
  std::atomic<bool> done{false};
  std::thread camera([&] {
    while (!done) {
      loop.cycle().put_frame(std::make_shared<PointCloud>(test::flat_grid(0.0, 2e-3, 10)),
                             monotonic_now(), monotonic_now());
    }
  });
  std::thread viewer([&] {
    double stiffness = 100.0;
    while (!done) {
      auto reader = loop.cycle().reader();
      ServoTick record{};
      while (!done && !reader.try_pop(record)) std::this_thread::yield();
      ServoSettings settings;
      settings.parameters.coupling.stiffness = stiffness =
          stiffness < 900.0 ? stiffness + 1.0 : 100;
      loop.cycle().set_settings(settings);
      static_cast<void>(loop.timing().wake_up.quantile(0.99));
      static_cast<void>(loop.statistics().heat.load());
    }
  });
  std::uint64_t seen = 0;
  ServoTick record{};
  while (seen < 300) {
    if (recorder.try_pop(record)) {
      EXPECT_EQ(record.number, seen);
      ++seen;
    } else {
      std::this_thread::yield();
    }
  }
  done = true;
  camera.join();
  viewer.join();
  loop.stop();
  while (recorder.try_pop(record)) ++seen;
  const CycleStatistics& statistics = loop.statistics();
  EXPECT_EQ(recorder.lost(), 0U);
  EXPECT_EQ(statistics.ticks, seen);
  EXPECT_EQ(loop.timing().wake_up.count(), seen);
  EXPECT_GT(statistics.frames_adopted, 0U);
  EXPECT_EQ(record.frame_number, statistics.frames_adopted + statistics.frames_dropped);
  EXPECT_EQ(device.writes, static_cast<int>(seen) + 1) << "and a last one without force";
  EXPECT_TRUE(device.force.isZero());
}

// Hazard: session-stops
TEST(ServoLoop, CanBeDestroyedBeforeItStartedAndStoppedTwice) {
  FakeDevice device;
  { const ServoLoop never_started(make_method("paper"), device); }
  EXPECT_EQ(device.writes, 0);
  ServoLoop loop(make_method("paper"), device);
  EXPECT_EQ(loop.timing().compute.count(), 0U);
  loop.start();
  loop.stop();
  EXPECT_EQ(device.enables, 1);
  EXPECT_GE(device.disables, 1);
  const int writes = device.writes;
  loop.stop();
  EXPECT_EQ(device.writes, writes);
}

}  // namespace test_servo_loop
}  // namespace palpate
