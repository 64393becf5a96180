// SPDX-License-Identifier: Apache-2.0
// The monitor: what the newest frame itself shows overrules every estimate.
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/sight/monitor.hpp"
#include "palpate/kernel/sight/sight.hpp"
#include "palpate/kernel/sight/tracker.hpp"

#include "tests/support/grids.hpp"

namespace palpate {
namespace test_monitor {

constexpr double interval = 1.0 / 30.0;
constexpr double r_c = 5e-3;
const Vec3 eye(0, 0, 1);

PointCloud plane_at(double z) { return PointCloud(test::flat_grid(z, 1.5e-3, 40), eye); }

// A contact pressed into a plane at z = 0 from above.
Monitor::Contact pressed(double hip_z, double proxy_z) {
  return {.hip = {0, 0, hip_z},
          .proxy = {0, 0, proxy_z},
          .normal = Vec3::UnitZ(),
          .touching = true,
          .noise = 1e-3,
          .deepest = 38e-3};
}

// A monitor that knows from a frame before that the proxy is in front of the plane, or behind it.
void meet(Monitor& monitor, double side) {
  const PointCloud plane = plane_at(0.0);
  monitor.start_frame();
  Monitor::Contact hovering = pressed(side * 0.03, side * 0.03);
  hovering.touching = false;
  EXPECT_EQ(monitor.judge(plane, hovering).action, Monitor::Action::none);
  monitor.start_frame();
}

TEST(Monitor, LeavesAHandAloneThatPressesIntoWhatItSees) {
  Monitor monitor;
  meet(monitor, 1.0);
  const PointCloud plane = plane_at(0.0);
  for (const double hip : {0.004, 0.0, -0.01, -0.1}) {
    const Monitor::Verdict verdict = monitor.judge(plane, pressed(hip, r_c));
    EXPECT_EQ(verdict.action, Monitor::Action::none) << hip;
    EXPECT_FALSE(verdict.behind) << hip;
  }
}

TEST(Monitor, ReleasesAHandInSpaceThatTheFrameShowsFree) {
  Monitor monitor;
  meet(monitor, 1.0);
  const PointCloud plane = plane_at(0.0);
  EXPECT_EQ(monitor.judge(plane, pressed(0.03, 0.0)).action, Monitor::Action::release);
  EXPECT_EQ(monitor.judge(plane, pressed(0.03, -0.01)).action, Monitor::Action::release);
}

TEST(Monitor, SaysNothingAboutAHandThatNoCameraSees) {
  Monitor monitor;
  meet(monitor, 1.0);
  const PointCloud nothing(std::vector<Vec3>{}, eye);
  EXPECT_EQ(monitor.judge(nothing, pressed(0.03, 0.0)).action, Monitor::Action::none);
  const PointCloud no_viewpoint(test::flat_grid(0.0, 1.5e-3, 40));
  monitor.start_frame();
  EXPECT_EQ(monitor.judge(no_viewpoint, pressed(0.03, 0.0)).action, Monitor::Action::none);
}

TEST(Monitor, LooksWiderWhereTheImageIsCoarse) {
  Monitor monitor;
  meet(monitor, 1.0);
  const PointCloud coarse(test::flat_grid(0.0, 15e-3, 10), eye);
  EXPECT_EQ(monitor.judge(coarse, pressed(0.05, 0.0)).action, Monitor::Action::release);
}

TEST(Monitor, TakesOffAForceThatPointsAwayFromTheCameraUnlessTheSurfaceWasMetFromBehind) {
  const PointCloud plane = plane_at(0.0);
  Monitor::Contact pulled = pressed(0.004, -0.004);
  pulled.normal = -Vec3::UnitZ();
  Monitor in_front;
  meet(in_front, 1.0);
  EXPECT_EQ(in_front.judge(plane, pulled).action, Monitor::Action::release);
  // A hand inside is not set free there.
  pulled.hip.z() = -0.006;
  const Monitor::Verdict inside = in_front.judge(plane, pulled);
  EXPECT_EQ(inside.action, Monitor::Action::return_to_front);
  EXPECT_NEAR(inside.front.z(), r_c, 1e-4);
  Monitor behind;
  meet(behind, -1.0);
  pulled.hip.z() = 0.02;
  EXPECT_EQ(behind.judge(plane, pulled).action, Monitor::Action::none);
  // Farther through than the coupling has force for.
  pulled.hip.z() = 0.06;
  EXPECT_EQ(behind.judge(plane, pulled).action, Monitor::Action::let_go);
}

TEST(Monitor, BringsAProxyBackInFrontWhenTwoFramesShowItBehind) {
  Monitor monitor;
  meet(monitor, 1.0);
  const PointCloud plane = plane_at(0.0);
  Monitor::Contact lost = pressed(-0.01, -0.01);
  lost.touching = false;
  Monitor::Verdict verdict = monitor.judge(plane, lost);
  EXPECT_TRUE(verdict.behind);
  EXPECT_EQ(verdict.action, Monitor::Action::none);
  monitor.start_frame();
  verdict = monitor.judge(plane, lost);
  ASSERT_EQ(verdict.action, Monitor::Action::return_to_front);
  EXPECT_NEAR(verdict.front.z(), r_c, 1e-4);
  EXPECT_NEAR(verdict.normal.z(), 1.0, 1e-6);
}

TEST(Monitor, TakesNoMoreForNoiseThanTheNewestFrameScatters) {
  // Before a camera that shakes the estimate of the noise is too large.
  const PointCloud plane = plane_at(0.0);
  Monitor monitor;
  meet(monitor, 1.0);
  Monitor::Contact inside = pressed(-0.012, -0.006);
  inside.noise = 5e-3;
  EXPECT_TRUE(monitor.judge(plane, inside).behind);
}

TEST(Monitor, BringsBackAtOnceAProxyThatPassesThroughAgain) {
  Monitor monitor;
  meet(monitor, 1.0);
  const PointCloud plane = plane_at(0.0);
  const Monitor::Contact lost = pressed(-0.01, -0.01);
  monitor.judge(plane, lost);
  monitor.start_frame();
  Monitor::Verdict verdict = monitor.judge(plane, lost);
  ASSERT_EQ(verdict.action, Monitor::Action::return_to_front);
  EXPECT_FALSE(verdict.again);
  // In the next tick it lies behind the margin, then not even that deep, then deep in a new frame.
  for (const double deep : {-0.01, -0.001, -0.01}) {
    verdict = monitor.judge(plane, pressed(-0.01, deep));
    ASSERT_EQ(verdict.action, Monitor::Action::return_to_front) << deep;
    EXPECT_TRUE(verdict.again);
    if (deep == -0.001) monitor.start_frame();
  }
  // After a frame in which it stayed in front, two show it behind again.
  for (int frame = 0; frame < 2; ++frame) {
    monitor.start_frame();
    EXPECT_FALSE(monitor.judge(plane, pressed(-0.01, r_c)).behind);
  }
  EXPECT_EQ(monitor.judge(plane, lost).action, Monitor::Action::none);
}

TEST(Monitor, GivesNoSecondForceToAHandInFrontOfWhatItSees) {
  Monitor monitor;
  meet(monitor, 1.0);
  const PointCloud plane = plane_at(0.0);
  monitor.judge(plane, pressed(-0.01, -0.01));
  monitor.start_frame();
  ASSERT_EQ(monitor.judge(plane, pressed(-0.01, -0.01)).action, Monitor::Action::return_to_front);
  EXPECT_EQ(monitor.judge(plane, pressed(0.001, -0.01)).action, Monitor::Action::none);
}

TEST(Monitor, WaitsForAsManyFramesAsItIsTold) {
  Monitor monitor;
  Parameters parameters;
  parameters.sight.evidence_frames = 3;
  monitor.set(parameters);
  meet(monitor, 1.0);
  const PointCloud plane = plane_at(0.0);
  Monitor::Contact lost = pressed(-0.01, -0.01);
  lost.touching = false;
  for (int frame = 1; frame <= 3; ++frame) {
    EXPECT_EQ(monitor.judge(plane, lost).action,
              frame < 3 ? Monitor::Action::none : Monitor::Action::return_to_front);
    monitor.start_frame();
  }
}

TEST(Monitor, SeesAProxyBehindASlopeThatACoarseCameraSees) {
  // A slope of 60 degrees in pixels 10 mm wide: ten of them span 60 mm along the line of sight.
  const Intrinsics k{.width = 80, .height = 60, .fx = 60.0, .fy = 60.0, .cx = 40.0, .cy = 30.0};
  const auto rays = std::make_shared<ViewingRays>(k);
  std::vector<std::uint16_t> depth;
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const double z = 0.6 / (1.0 - std::sqrt(3.0) * rays->ray(u, v).x());
      depth.push_back(z > 0.0 && z < 6.0 ? static_cast<std::uint16_t>(z * 1e4 + 0.5) : 0);
    }
  }
  const DepthImage slope(rays, depth, 1e4);
  Monitor monitor;
  // Depth grows along the camera's axis: 30 mm before the slope, then 15 mm behind it.
  Monitor::Contact contact = pressed(0.57, 0.57);
  contact.touching = false;
  for (int frame = 0; frame < 3; ++frame) {
    monitor.start_frame();
    EXPECT_FALSE(monitor.judge(slope, contact).behind);
  }
  contact.hip.z() = contact.proxy.z() = 0.615;
  monitor.start_frame();
  EXPECT_TRUE(monitor.judge(slope, contact).behind);
  monitor.start_frame();
  const Monitor::Verdict verdict = monitor.judge(slope, contact);
  ASSERT_EQ(verdict.action, Monitor::Action::return_to_front);
  EXPECT_NEAR(verdict.front.z(), 0.6 - r_c, 2e-3);
}

// A slope of 45 degrees leaves the image: what is still seen of it lies beside the proxy, and
// nearer to the camera than the proxy is.
TEST(Monitor, TakesNoSlopeThatIsSeenBesideTheProxyForASurfaceBeforeIt) {
  const auto slope = [](double begins) {
    std::vector<Vec3> points;
    for (const Vec3& p : test::flat_grid(0.0, 1.5e-3, 60))
      if (p.x() < begins) points.emplace_back(p.x(), p.y(), -p.x());
    return PointCloud(points, eye);
  };
  Monitor monitor;
  Monitor::Contact contact = pressed(-2e-3, 1.5 * r_c);
  const PointCloud whole = slope(1.0);
  for (int frame = 0; frame < 3; ++frame) {
    monitor.start_frame();
    EXPECT_FALSE(monitor.judge(whole, contact).behind);
  }
  for (const double begins : {-6e-3, -10e-3, -15e-3, -20e-3}) {
    const PointCloud rest = slope(begins);
    monitor.start_frame();
    const Monitor::Verdict verdict = monitor.judge(rest, contact);
    EXPECT_FALSE(verdict.behind) << begins;
    EXPECT_EQ(verdict.action, Monitor::Action::none) << begins;
  }
}

TEST(Monitor, TakesWhatComesFarBeforeTheContactForSomethingElse) {
  Monitor monitor;
  meet(monitor, 1.0);
  const PointCloud arm = plane_at(0.1);
  for (int k = 0; k < 10; ++k) {
    monitor.start_frame();
    const Monitor::Verdict verdict = monitor.judge(arm, pressed(-0.01, r_c));
    EXPECT_EQ(verdict.action, Monitor::Action::none);
    EXPECT_FALSE(verdict.behind);
  }
}

TEST(Monitor, TakesNoVisitorForAnEdgeThatAMovingHandHasPassed) {
  Monitor monitor;
  meet(monitor, 1.0);
  const PointCloud plane = plane_at(0.0);
  const PointCloud visitor = plane_at(0.2);
  const auto judge = [&](const PointCloud& seen, double x) {
    monitor.start_frame();
    Monitor::Contact moving = pressed(-0.004, -0.004);
    moving.hip.x() = moving.proxy.x() = x;
    moving.touching = false;
    return monitor.judge(seen, moving);
  };
  for (int i = 0; i < 6; ++i) EXPECT_EQ(judge(visitor, 0.003 * i).action, Monitor::Action::none);
  // The hand is still one that belongs in front.
  EXPECT_EQ(judge(plane, 0.02).action, Monitor::Action::none);
  EXPECT_EQ(judge(plane, 0.02).action, Monitor::Action::return_to_front);
}

TEST(Monitor, LetsAHandGoRoundAnEdgeBehindABody) {
  // A plate over x < 0, a floor 0.2 m below it.
  const PointCloud plate(
      test::grid(1.5e-3, 60, [](double x, double) { return x < 0.0 ? 0.0 : -0.2; }), eye);
  Monitor monitor;
  for (int k = 0; k < 40; ++k) {
    monitor.start_frame();
    Monitor::Contact hand = pressed(-0.02, -0.02);
    hand.touching = false;
    hand.hip.x() = hand.proxy.x() = 0.03 - 1.5e-3 * k;
    const Monitor::Verdict verdict = monitor.judge(plate, hand);
    EXPECT_EQ(verdict.action, Monitor::Action::none) << k;
  }
}

/// Plays a camera and a hand to sight for `ticks` milliseconds.
/// @param hip      [m] world, by time
/// @param on_tick  (double t, const Tick&)
template <class Hip, class OnTick>
void play(SyntheticCamera& camera, const Hip& hip, int ticks, const OnTick& on_tick) {
  Sight sight;
  sight.seat(hip(0.0));
  Frame frame;
  for (int i = 0, k = 0; i <= ticks; ++i) {
    const double t = 1e-3 * i;
    if (t >= k * interval - 1e-9) {
      Frame next = *camera.next();
      sight.observe({*next.cloud, next.stamp});
      frame = std::move(next);
      ++k;
    }
    on_tick(t, sight.tick(hip(t), t));
    if (testing::Test::HasFatalFailure()) return;
  }
}

TEST(SightMonitor, AHandThatPressesSlidesAndLiftsIsFree) {
  // A RealSense's noise at 1.2 m once left the proxy behind the plane: 20 N down, for ever.
  const auto camera = open_synthetic_camera(
      Uri("synthetic:plane?tilt=34deg&distance=1.2m&sensor=d4xx&seed=3&size=320x240&fov=30.38deg"));
  const auto camera_full =
      open_synthetic_camera(Uri("synthetic:plane?tilt=34deg&distance=1.2m&sensor=d4xx&seed=3"));
  const auto between = [](double a, double b, double from, double to, double t) {
    return a + (b - a) * std::clamp((t - from) / (to - from), 0.0, 1.0);
  };
  const auto hip = [&](double t) {
    const double slide = between(0.0, 0.03, 1.3, 2.0, t);
    return Vec3(0.003 + slide, 0.001 + slide / 3.0,
                between(0.06, -0.01, 0.2, 1.0, t) + between(0.0, 0.09, 2.0, 2.6, t));
  };
  for (SyntheticCamera* source : {camera.get(), camera_full.get()}) {
    play(*source, hip, 3000, [&](double t, const Tick& tick) {
      if (hip(t).z() > 0.05) {
        ASSERT_EQ(tick.force.norm(), 0.0) << t;
      }
    });
  }
}

TEST(SightMonitor, LeavesNothingOfAForceWhereTheNewestFrameShowsFreeSpace) {
  Sight sight((Parameters()));
  const PointCloud plane = plane_at(0.0);
  const PointCloud gone = plane_at(-0.06);
  const Vec3 hip(0, 0, -5e-3);
  sight.seat(Vec3(0, 0, 0.03));
  double t = 0.0;
  Tick tick;
  for (int frame = 0; frame < 12; ++frame) {
    sight.observe({plane, frame * interval});
    for (; t < (frame + 1) * interval; t += 1e-3) tick = sight.tick(hip, t);
  }
  ASSERT_GT(tick.force.z(), 1.0);
  sight.observe({gone, 12 * interval});
  EXPECT_EQ(sight.tick(hip, t).force, Vec3(0, 0, 0)) << "not even what is left of the old one";
}

TEST(SightMonitor, FindsThePlaneAgainWithinTwoTenthsOfASecondAndWithoutAKick) {
  // Behind the plane after a jump that no frame showed: the proxy is put there by the hand itself.
  Sight sight;
  sight.seat({0, 0, 0.03});
  const PointCloud low = plane_at(-0.03);
  const PointCloud high = plane_at(0.01);
  double t = 0.0;
  double found = 0.0;
  double last = 0.0;
  for (int k = 0; k < 60; ++k) {
    // Nothing is seen while the plane rises past the free hand.
    const PointCloud nothing(std::vector<Vec3>{}, eye);
    sight.observe({k < 10 ? low : k < 20 ? nothing : high, k * interval});
    for (int i = 0; i < 33; ++i) {
      t = k * interval + i * 1e-3;
      const Tick tick = sight.tick({0, 0, 0}, t);
      if (k >= 20 && found == 0.0 && (tick.flags & returned_to_front) != 0)
        found = t - 20 * interval;
      // 6 N over half a second.
      EXPECT_LE(tick.force.norm() - last, 0.025) << t;
      last = tick.force.norm();
    }
  }
  EXPECT_GT(found, 0.0);
  EXPECT_LT(found, 0.2);
  EXPECT_NEAR(last, 6.0, 0.2);
}

TEST(SightMonitor, AForceThatReturnsAfterTheStreamStoppedRisesSlowly) {
  Sight sight;
  sight.seat({0, 0, 0.03});
  const PointCloud plane = plane_at(0.0);
  double last = 0.0;
  for (int i = 0, k = 0; i < 4000; ++i) {
    const double t = 1e-3 * i;
    if (t >= k * interval - 1e-9) {
      if (k < 30 || k > 40) sight.observe({plane, k * interval});
      ++k;
    }
    const double force = sight.tick({0, 0, i < 100 ? 0.03 : -0.01}, t).force.norm();
    if (i > 1000) {
      EXPECT_LE(force - last, 0.025) << t;
    }
    last = force;
  }
  EXPECT_NEAR(last, 6.0, 0.2);
}

TEST(SightMonitor, FeelsARestingPlaneInFullHoweverSlowOrLateTheCamera) {
  const PointCloud plane = plane_at(0.0);
  for (const double rate : {5.0, 9.0, 30.0, 90.0}) {
    for (const double latency : {0.0, 0.1, 0.15, 0.5}) {
      Sight sight;
      sight.seat({0, 0, 0.03});
      for (int i = 0, k = 0; i < 4000; ++i) {
        const double t = 1e-3 * i;
        if (t >= k / rate + latency - 1e-9) {
          sight.observe({plane, k / rate});
          ++k;
        }
        const Tick tick = sight.tick({0, 0, t < 1.5 ? 0.03 : -0.01}, t);
        if (t > 2.5) {
          ASSERT_NEAR(tick.force.z(), 6.0, 5e-3) << rate << " Hz, " << latency << " s";
        }
      }
    }
  }
}

// Pixels of up to 14 mm, where no disc of a fine image's width has a point, on planes up to 50
// degrees from facing the camera.
TEST(Sight, FeelsAndLetsGoOfAPlaneInFullHoweverCoarseTheImage) {
  for (const char* size : {"424x240", "160x120", "80x60"}) {
    for (const char* tilt : {"0deg", "25deg", "50deg"}) {
      const auto camera = open_synthetic_camera(
          Uri(std::string("synthetic:plane?distance=0.95m&size=") + size + "&tilt=" + tilt));
      const auto hip = [](double t) {
        const double down = std::clamp((t - 0.2) / 0.5, 0.0, 1.0);
        const double slide = std::clamp((t - 1.0) / 0.4, 0.0, 1.0);
        const double up = std::clamp((t - 1.5) / 0.4, 0.0, 1.0);
        return Vec3(0.003 + 0.03 * slide, 0.001, 0.05 - 0.06 * down + 0.06 * up);
      };
      play(*camera, hip, 2000, [&](double time, const Tick& tick) {
        if (time > 0.8 && time < 1.5) {
          ASSERT_NEAR(tick.force.norm(), 6.0, 0.1) << size << ' ' << tilt << ' ' << time;
        }
        if (time > 1.9) {
          ASSERT_EQ(tick.force.norm(), 0.0) << size << ' ' << tilt << ' ' << time;
        }
      });
    }
  }
}

TEST(SightTracker, CountsTheTimeOfAHoldFromItsBeginning) {
  // After a frame without points, a line of points far below: it is no surface to go on from.
  const PointCloud plane = plane_at(0.0);
  const PointCloud nothing(std::vector<Vec3>{}, eye);
  std::vector<Vec3> points;
  for (int i = -20; i <= 20; ++i) points.emplace_back(1.2e-3 * i, 0.0, -0.1);
  const PointCloud line(points, eye);
  SightTracker tracker;
  ObservedClouds clouds;
  const auto frame = [&](const PointCloud& cloud, int k) {
    clouds.take(0, cloud);
    tracker.frame(clouds, nullptr, 0, k * interval, interval, Vec3::Zero(), Vec3(0, 0, r_c), 90.0);
  };
  for (int k = 0; k < 10; ++k) frame(plane, k);
  ASSERT_TRUE(tracker.tracking());
  frame(nothing, 10);
  ASSERT_TRUE(tracker.holding());
  const double since = tracker.held_since();
  for (int k = 11; k < 40; ++k) {
    frame(line, k);
    if (!tracker.holding()) break;
    EXPECT_EQ(tracker.held_since(), since) << k;
    EXPECT_NEAR(tracker.contact(Vec3(0, 0, 0.01), k * interval).distance, 0.01, 1e-4) << k;
  }
}

}  // namespace test_monitor
}  // namespace palpate
