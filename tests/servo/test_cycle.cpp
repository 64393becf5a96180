// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/servo/free_side.hpp"

#include "tests/servo/fake_device.hpp"
#include "tests/support/allocations.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace test_cycle {

using test::FakeDevice;
using test::flat_grid;

constexpr double ms = 1e-3;

std::shared_ptr<const Cloud> plane_at(double z) {
  return std::make_shared<PointCloud>(flat_grid(z, 1.5e-3, 30), Vec3(0, 0, 1));
}

// Cycles at 1 kHz on a clock of their own, under a camera that shows a plane at 30 Hz.
struct Session {
  explicit Session(const ServoSettings& settings = {})
      : cycle(make_method("paper"), device, settings), reader(cycle.reader()) {
    device.hand.position = {0, 0, 0.02};
  }

  ServoTick run(double dt = ms) {
    t += dt;
    if (cloud && t >= next_frame) {
      cycle.put_frame(cloud, t, t);
      next_frame = t + 1.0 / 30.0;
    }
    cycle.run({.t = t});
    ServoTick record{};
    EXPECT_TRUE(reader.try_pop(record));
    return record;
  }
  ServoTick run_for(double seconds) {
    ServoTick record{};
    for (int i = 0; i < std::lround(seconds / ms); ++i) record = run();
    return record;
  }
  // Down to `z` at 0.05 m/s.
  ServoTick press_to(double z) {
    ServoTick record{};
    while (device.hand.position.z() > z) {
      device.hand.position.z() = std::max(device.hand.position.z() - 5e-5, z);
      record = run();
    }
    return record;
  }

  FakeDevice device;
  Cycle cycle;
  TickRing<ServoTick>::Reader reader;
  std::shared_ptr<const Cloud> cloud = plane_at(0.0);
  double t = 10.0;
  double next_frame = 0.0;
};

TEST(Cycle, GivesTheDeviceTheMethodsForceOnceTheHandIsEngaged) {
  Session session;
  session.run_for(2.0);
  const ServoTick record = session.press_to(-0.001);
  EXPECT_GT(record.force.z(), 0.5);
  EXPECT_EQ(record.force, record.tick.force);
  EXPECT_EQ(session.device.force, record.force);
  EXPECT_EQ(record.safety, 0U);
  EXPECT_EQ(record.hand, 1U);
}

// A tool that is always pressed and turned.
class Pressed final : public Method {
 public:
  void seat(const Vec3& /*proxy*/) noexcept override {}
  void observe(const Observation& /*seen*/) noexcept override {}
  void set_parameters(const Parameters& /*parameters*/) noexcept override {}
  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick = free_tick(hip, t, 0);
    tick.force = force;
    tick.torque = torque;
    tick.transient = transient;
    tick.normal = Vec3::UnitZ();
    return tick;
  }
  Vec3 force = Vec3::Zero(), torque = Vec3::Zero(), transient = Vec3::Zero();
};

// The chain takes a force off in two ticks then, and the gate at once.
// Hazard: late-loop, torque
TEST(Cycle, SaysWhatTheLastGateSentAfterAStall) {
  for (const double newtons : {3.0, 0.0}) {
    ServoSettings settings;
    settings.safety.max_force = 12.0;
    settings.placement.world_from_device = Eigen::AngleAxisd(0.3, Vec3::UnitX());
    FakeDevice device({.continuous_force = 3.3, .max_torque = 0.33});
    const auto tool = std::make_shared<Pressed>();
    Cycle cycle(tool, device, settings);
    TickRing<ServoTick>::Reader reader = cycle.reader();
    double t = 10.0;
    ServoTick record{};
    const auto run = [&](double dt) {
      t += dt;
      cycle.put_frame(plane_at(0.0), t, t);
      cycle.run({.t = t});
      while (reader.try_pop(record)) {
      }
    };
    for (int i = 0; i < 3000; ++i) {
      if (i == 2000) tool->force.z() = newtons;
      if (i == 2000) tool->torque = Vec3(0.05, 0.1, 0.25);
      run(ms);
    }
    EXPECT_EQ(device.wish.force_bounds.limit, 3.3) << "the device's, which is lower";
    EXPECT_EQ(record.force.z(), newtons);
    EXPECT_EQ(record.torque, tool->torque) << "to the bit";
    EXPECT_EQ(cycle.statistics().gate_cuts, 0U);
    run(6 * ms);
    EXPECT_TRUE(device.force.isZero(0.0) && device.torque.isZero(0.0));
    EXPECT_TRUE(record.force.isZero(0.0) && record.torque.isZero(0.0));
    EXPECT_TRUE(vector_of(device.wish.force).isZero(0.0)) << "is announced as it was sent";
    EXPECT_TRUE(vector_of(device.wish.torque).isZero(0.0));
    EXPECT_EQ(cycle.statistics().gate_cuts, 1U);
  }
}

// Hazard: chain-wrong, torque
TEST(Cycle, TellsTheLastGateWhatToJudgeBy) {
  ServoSettings settings;
  settings.placement.world_from_device = Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitX());
  settings.safety.max_force = 2.0;
  settings.safety.lost_age = 0.4;
  settings.safety.late_intervals = 2.5;
  settings.safety.ramp_time = 1.25;
  settings.safety.stall_time = 4 * ms;
  FakeDevice device({.continuous_force = 3.3, .max_torque = 0.33});
  const auto tool = std::make_shared<Pressed>();
  Cycle cycle(tool, device, settings);
  double t = 10.0;
  const auto run = [&](double seconds, bool frames = true) {
    for (int i = 0; i < std::lround(seconds / ms); ++i) {
      t += ms;
      if (frames && i % 33 == 0) cycle.put_frame(plane_at(0.0), t, t);
      cycle.run({.t = t});
    }
    return device.wish;
  };
  palpate_gate_wish wish = run(0.001);
  EXPECT_EQ(wish.engaged, 0) << "not yet";
  wish = run(2.0);
  EXPECT_TRUE(wish.engaged != 0 && wish.hand != 0 && wish.latched == 0 && wish.may_hold != 0);
  EXPECT_EQ(wish.t, t);
  EXPECT_EQ(wish.lost_age, 0.4);
  EXPECT_EQ(wish.late_intervals, 2.5);
  EXPECT_EQ(wish.ramp_time, 1.25);
  EXPECT_EQ(wish.longest_gap, 4 * ms);
  EXPECT_EQ(wish.longest_time, 1 * ms) << "SafetyChain's longest credit";
  EXPECT_EQ(wish.force_bounds.limit, 2.0);
  EXPECT_EQ(wish.force_bounds.rise, settings.safety.rise_rate);
  EXPECT_EQ(wish.force_bounds.fall, settings.safety.fall_rate);
  EXPECT_EQ(wish.torque_bounds.limit, 0.33);
  EXPECT_DOUBLE_EQ(wish.torque_bounds.rise, 0.1 * settings.safety.rise_rate);
  EXPECT_DOUBLE_EQ(wish.torque_bounds.fall, 0.1 * settings.safety.fall_rate);
  EXPECT_NEAR(wish.frame_age, 0.02, 0.02);
  EXPECT_LT(wish.frame_intervals, 1.5);

  tool->force = Vec3(0.0, 0.0, 1.0);
  tool->torque = Vec3(0.0, 0.0, 0.05);
  wish = run(1.0);
  EXPECT_NEAR(wish.force.y, 1.0, 1e-9) << "in the device's frame";
  EXPECT_NEAR(wish.torque.y, 0.05, 1e-9);
  EXPECT_LT((device.force - vector_of(wish.force)).norm(), 1e-12);
  EXPECT_EQ(device.torque, vector_of(wish.torque));
  EXPECT_EQ(wish.ring, 0.0);
  tool->force.z() += tool->transient.z() = 0.8;
  EXPECT_NEAR(run(ms).ring, 0.8, 1e-9);
  tool->force.z() -= tool->transient.z();
  tool->transient.setZero();
  run(0.1);
  EXPECT_EQ(cycle.statistics().gate_cuts, 0U);
  tool->force.setZero();
  run(0.5);
  EXPECT_TRUE(cycle.statistics().force_out) << "the watchdog waits no longer for a torque alone";

  device.hand.present = false;
  wish = run(0.01);
  EXPECT_TRUE(wish.hand == 0 && wish.engaged == 0 && wish.may_hold == 0);
  device.hand.present = true;
  wish = run(0.2, false);
  EXPECT_GT(wish.frame_intervals, 2.5) << "late";
  EXPECT_NEAR(wish.frame_age, 0.2, 0.06);
  tool->force = tool->torque = Vec3::Zero();
  run(2.0);
  for (const double x : {1.0, 0.0, 1.0, 0.0, 1.0}) {
    EXPECT_EQ(device.wish.latched, 0);
    tool->force.x() = x > 0.0 ? std::numeric_limits<double>::quiet_NaN() : 0.0;
    wish = run(0.01);
    EXPECT_TRUE(x == 0.0 || wish.engaged == 0) << "refused";
  }
  EXPECT_NE(wish.latched, 0);
  EXPECT_EQ(wish.may_hold, 0);
}

TEST(Cycle, UsesAFrameInTheFirstCycleAfterItWasPut) {
  Session session;
  session.cloud = nullptr;
  EXPECT_EQ(session.run().frame_number, 0U);
  session.cycle.put_frame(plane_at(0.0), session.t, session.t);
  session.cycle.put_frame(plane_at(0.001), session.t + 0.5 * ms, session.t);
  const ServoTick record = session.run();
  EXPECT_EQ(record.frame_number, 2U) << "and of two, the newer";
  EXPECT_EQ(record.tick.frame, 0);
  EXPECT_NEAR(record.frame_age, ms, 1e-9) << "since it arrived, whatever its stamp";
  EXPECT_EQ(session.cycle.statistics().frames_adopted, 1U);
  EXPECT_EQ(session.cycle.statistics().frames_dropped, 1U);
  EXPECT_LE(session.cycle.statistics().hand_over.max(), 1'000'001U);
}

TEST(Cycle, TurnsHandAndForceBetweenDeviceAndWorld) {
  // The device's y is the world's z, and 1 m on the device is 2 m in the scene.
  ServoSettings settings;
  settings.placement.world_from_device =
      Eigen::Translation3d(0, 0, 0.04) * Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitX());
  settings.placement.workspace_scale = 2.0;
  Session session(settings);
  session.device.hand.position = {0.003, 0.0, 0.002};
  EXPECT_LT((session.run().tick.hip - Vec3(0.006, -0.004, 0.04)).norm(), 1e-15);
  session.run_for(2.0);
  for (int i = 0; i < 1000; ++i) {
    session.device.hand.position.y() -= 2.05e-5;
    session.run();
  }
  const ServoTick record = session.run();
  EXPECT_NEAR(record.tick.hip.z(), -0.001, 1e-9);
  EXPECT_GT(record.force.z(), 0.5);
  EXPECT_LT(
      (session.device.force - Vec3(record.force.x(), record.force.z(), -record.force.y())).norm(),
      1e-12);
}

TEST(Cycle, HoldsTheHipWhileTheHandIsClutchedAndGoesOnFromThere) {
  Session session;
  session.run_for(2.0);
  session.device.hand.clutched = true;
  session.device.hand.position = {0.1, 0, 0.3};
  ServoTick record = session.run();
  EXPECT_EQ(record.tick.hip, Vec3(0, 0, 0.02));
  EXPECT_EQ(record.hand, 3U);
  EXPECT_TRUE(record.safety & disengaged);
  session.device.hand.clutched = false;
  EXPECT_LT((session.run().tick.hip - Vec3(0, 0, 0.02)).norm(), 1e-15);
  session.device.hand.position.z() -= 0.01;
  EXPECT_LT((session.run().tick.hip - Vec3(0, 0, 0.01)).norm(), 1e-15);
}

// Hazard: not-a-number
TEST(Cycle, ForgetsAHandThatWasNoNumberOnceItIsOneAgain) {
  Session session;
  session.run_for(0.1);
  session.device.hand.clutched = true;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), 1e300}) {
    session.device.hand.position.x() = bad;
    const ServoTick record = session.run();
    EXPECT_TRUE(record.safety & input_refused);
    EXPECT_TRUE(record.force.isZero());
    session.device.hand.clutched = false;
  }
  session.device.hand.position.x() = 0.0;
  EXPECT_EQ(session.run().tick.hip, Vec3(0, 0, 0.02));
}

// Hazard: lost-camera
TEST(Cycle, TakesTheForceOffWhenTheCameraRepeatsItselfOrStandsStill) {
  const auto force_after = [](double seconds, auto feed) {
    Session session;
    session.run_for(2.0);
    session.press_to(-0.001);
    const double stamp = session.t;
    const std::shared_ptr<const Cloud> cloud = session.cloud;
    session.cloud = nullptr;
    for (int i = 0; i < std::lround(seconds / ms); ++i) {
      feed(session, cloud, stamp);
      session.run();
    }
    return session.device.force.norm();
  };
  const auto nothing = [](Session&, const auto&, double) {};
  EXPECT_GT(force_after(0.05, nothing), 0.5);
  EXPECT_EQ(force_after(0.6, nothing), 0.0);
  EXPECT_EQ(force_after(0.6, [](Session& s, const auto& cloud,
                                double stamp) { s.cycle.put_frame(cloud, stamp, s.t); }),
            0.0)
      << "the same frame again and again";
  EXPECT_EQ(force_after(0.6, [](Session& s, const auto& cloud,
                                double) { s.cycle.put_frame(cloud, s.t + 1e6, s.t); }),
            0.0)
      << "stamps from another clock";
  EXPECT_EQ(force_after(0.6,
                        [](Session& s, const auto& cloud, double) {
                          s.cycle.put_frame(cloud, std::numeric_limits<double>::quiet_NaN(), s.t);
                        }),
            0.0);
  EXPECT_GT(force_after(0.6, [](Session& s, const auto& cloud,
                                double) { s.cycle.put_frame(cloud, s.t, s.t); }),
            0.5);
}

// A session with two cameras that show the same plane, each at 30 Hz.
struct TwoCameras : Session {
  void run_for(double seconds, bool second_lives) {
    for (int i = 0; i < std::lround(seconds / ms); ++i) {
      if (t >= next_frame) {
        frames[0].stamp = t;
        if (second_lives) frames[1].stamp = t + 1e-6;
        cycle.put_frame(plane_at(0.0), t, frames, t);
        next_frame = t + 1.0 / 30.0;
      }
      cycle.run({.t = t += ms});
      EXPECT_TRUE(reader.try_pop(record));
    }
  }
  std::array<CameraFrame, 2> frames{CameraFrame{.camera = 0}, CameraFrame{.camera = 1}};
  ServoTick record{};
};

// Hazard: lost-camera
TEST(Cycle, TakesTheForceOffWhenOneOfTwoCamerasDies) {
  TwoCameras session;
  session.cloud = nullptr;
  session.run_for(2.0, true);
  for (int i = 0; i < 420; ++i) {
    session.device.hand.position.z() -= 5e-5;
    session.run_for(ms, true);
  }
  EXPECT_GT(session.device.force.z(), 0.5);
  EXPECT_EQ(session.record.safety, 0U);
  session.run_for(0.099, false);
  EXPECT_GT(session.device.force.z(), 0.5);
  session.run_for(0.42, false);
  EXPECT_EQ(session.device.force.norm(), 0.0);
  EXPECT_TRUE(session.record.safety & frame_lost);
  EXPECT_GT(session.record.frame_age, 0.5);
}

TEST(Cycle, RefusesFramesOfNoCameraOrOfTooMany) {
  Session session;
  const std::vector<CameraFrame> many(Freshness::max_cameras + 1);
  EXPECT_THROW(session.cycle.put_frame(session.cloud, 1.0, many, 1.0), Error);
  EXPECT_THROW(session.cycle.put_frame(session.cloud, 1.0, {many.data(), 0}, 1.0), Error);
  const CameraFrame beyond{.camera = Freshness::max_cameras, .stamp = 1.0};
  EXPECT_THROW(session.cycle.put_frame(session.cloud, 1.0, {&beyond, 1}, 1.0), Error);
}

TEST(Cycle, CountsAFramesAgeFromWhenItWasPutAndNotFromWhenItWasTaken) {
  Session session;
  session.cloud = nullptr;
  session.run();
  session.cycle.put_frame(plane_at(0.0), session.t + 0.03, session.t);
  EXPECT_NEAR(session.run(0.1).frame_age, 0.1, 1e-9);
  session.cycle.put_frame(plane_at(0.0), session.t - 0.01, session.t + 1e6);
  EXPECT_NEAR(session.run().frame_age, 0.011, 1e-9) << "put on another clock: counts from now";
}

TEST(Cycle, AdoptsTheToleranceOfFutureStampsWithTheSettings) {
  const auto force_with = [](double tolerance) {
    ServoSettings settings;
    settings.safety.future_tolerance = tolerance;
    Session session;
    session.cycle.set_settings(settings);
    session.run_for(2.0);
    session.press_to(-0.001);
    session.cloud = nullptr;
    for (int i = 0; i < 600; ++i) {
      if (i % 33 == 0) session.cycle.put_frame(plane_at(0.0), session.t + 0.2, session.t);
      session.run();
    }
    return session.device.force.norm();
  };
  EXPECT_EQ(force_with(0.19), 0.0);
  EXPECT_GT(force_with(0.21), 0.5);
}

// Hazard: repeated-fault
TEST(Cycle, LatchesRepeatedFaultsUntilTheyAreReset) {
  Session session;
  session.run_for(2.0);
  for (int i = 0; i < 3; ++i) {
    session.device.hand.position.x() = std::numeric_limits<double>::quiet_NaN();
    session.run();
    session.device.hand.position.x() = 0.0;
    session.run_for(0.1);
  }
  EXPECT_EQ(session.cycle.statistics().latched_by, std::uint32_t{input_refused});
  EXPECT_EQ(session.run_for(3.0).safety, fault_latched | disengaged);
  session.cycle.reset_faults();
  session.run_for(2.0);
  EXPECT_EQ(session.cycle.statistics().latched_by, 0U);
  EXPECT_GT(session.press_to(-0.001).force.z(), 0.5);
}

TEST(Cycle, SaysHowWarmTheMotorsAre) {
  Session session;
  session.run_for(1.0);
  EXPECT_NEAR(session.cycle.statistics().heat, std::exp(-1.0 / 20.0), 1e-3);
}

// What real methods do may never be taken for a fault: a plane that moves by up to 20 mm at 1 Hz,
// with noise of its own in each frame, under a hand that presses, slides and lifts.
// Hazard: wrong-direction
TEST(Cycle, FindsNoFaultInTheDirectionsOfHonestContacts) {
  constexpr int runs = test::sanitized ? 4 : 24;
  int forceful = 0;
  for (int run = 0; run < runs; ++run) {
    std::mt19937_64 random(static_cast<std::uint64_t>(run));
    std::normal_distribution<double> noise(0.0, 0.5e-3 * (run % 4));
    Session session;
    session.cloud = nullptr;
    ServoTick record{};
    for (int i = 0; i < 4000; ++i) {
      const double z = 0.01 * std::sin(2.0 * std::numbers::pi * (run % 3) * 0.5 * i * ms);
      if (i % 33 == 0) {
        std::vector<Vec3> points = flat_grid(z, 1.5e-3, 30);
        for (Vec3& point : points) point.z() += noise(random);
        session.cycle.put_frame(std::make_shared<PointCloud>(points, Vec3(0, 0, 1)), session.t,
                                session.t);
      }
      session.device.hand.position = {0.02 * std::sin(2.0 * i * ms), 0,
                                      0.004 + z + 0.006 * std::cos(3.0 * i * ms)};
      if (i < 1000) session.device.hand.position.z() += 0.02;
      record = session.run();
      ASSERT_EQ(record.safety & direction_refused, 0U) << "run " << run << ", tick " << i;
      if (record.force.norm() > 0.2) ++forceful;
    }
  }
  EXPECT_GT(forceful, 400 * runs) << "nothing was at stake";
}

// Hazard: scene-jumps
TEST(Cycle, MovesTheHipWithThePlacementAndSeatsTheProxyAnew) {
  Session session;
  session.run_for(2.0);
  ServoSettings settings;
  settings.placement.world_from_device.translation() = Vec3(0.01, 0, 0.02);
  session.cycle.set_settings(settings);
  const ServoTick record = session.run();
  EXPECT_LT((record.tick.hip - Vec3(0.01, 0, 0.04)).norm(), 1e-12);
  EXPECT_TRUE(record.hand & proxy_reseated);
  EXPECT_FALSE(session.run().hand & proxy_reseated) << "once";
}

// Hazard: scene-jumps
TEST(Cycle, LetsGoOfTheHandWhereAnotherSceneBegins) {
  Session session;
  session.run_for(2.0);
  ASSERT_GT(session.press_to(-0.002).force.norm(), 0.5);
  session.cycle.command([](ServoCommands& told) { ++told.scene; });
  ServoTick record = session.run();
  EXPECT_TRUE(record.hand & proxy_reseated);
  EXPECT_EQ(record.gain, 0.0);
  // What is left of the force falls at fall_rate, and comes back over ramp_time at the soonest.
  for (int i = 0; i < 50; ++i) record = session.run();
  EXPECT_EQ(record.force.norm(), 0.0);
  session.cycle.set_settings({});
  EXPECT_FALSE(session.run().hand & proxy_reseated) << "the same scene";
}

TEST(Cycle, KeepsTheForceOffWhileItIsOnHold) {
  Session session;
  session.run_for(2.0);
  const ServoTick before = session.press_to(-0.002);
  ASSERT_GT(before.force.norm(), 0.5);
  session.cycle.command([](ServoCommands& told) { told.hold = true; });
  ServoTick record = session.run();
  EXPECT_TRUE(record.hand & force_on_hold);
  EXPECT_TRUE(record.safety & disengaged);
  EXPECT_FALSE(record.safety & force_cut) << "no limit that nobody set";
  EXPECT_LT(record.force.norm(), before.force.norm());
  for (int i = 0; i < 50; ++i) record = session.run();
  EXPECT_EQ(record.force.norm(), 0.0);
  EXPECT_GT(record.tick.force.norm(), 0.5) << "the method goes on";
  // Other commands do not end it, and afterwards the hand has to engage anew.
  session.cycle.set_settings({});
  EXPECT_TRUE(session.run().hand & force_on_hold);
  session.cycle.command([](ServoCommands& told) { told.hold = false; });
  for (int i = 0; i < 50; ++i) record = session.run();
  EXPECT_FALSE(record.hand & force_on_hold);
  EXPECT_EQ(record.force.norm(), 0.0);
  EXPECT_TRUE(record.safety & disengaged);
}

// Hazard: fast-hand
TEST(Cycle, JudgesTheHandsSpeedOnTheDeviceWhateverTheScale) {
  ServoSettings settings;
  settings.placement.workspace_scale = 10.0;
  Session session(settings);
  session.device.hand.position = {0, 0, 0.05};
  session.run_for(0.5);
  std::uint32_t flags = 0;
  ServoTick record{};
  for (int i = 0; i < 100; ++i) {
    session.device.hand.position.x() += 0.3 * ms;  // 3 m/s in the scene
    record = session.run();
    flags |= record.safety;
  }
  EXPECT_FALSE(flags & hand_too_fast);
  EXPECT_EQ(record.position, session.device.hand.position);
}

// Hazard: nobody-holds
TEST(Cycle, LetsGoOfADeviceThatNobodyHolds) {
  Session session;
  session.run_for(2.0);
  ASSERT_GT(session.press_to(-0.002).force.norm(), 0.5);
  session.device.hand.present = false;
  session.run();
  const ServoTick record = session.run();
  EXPECT_EQ(record.force.norm(), 0.0);
  EXPECT_TRUE(record.safety & disengaged);
}

// Hazard: late-frame
TEST(Cycle, SaysThatAFrameIsLateWhateverTheClockOfWhoPutIt) {
  for (const double ahead : {0.0, 100.0}) {
    Session session;
    session.cloud = nullptr;
    for (int i = 0; i < 300; ++i) {
      if (i % 10 == 0) {
        const double stamp = session.t;
        EXPECT_GT(session.cycle.put_frame(plane_at(0.0), stamp, session.t + ahead), 0U);
        EXPECT_EQ(session.run().frame_stamp, stamp);
      } else {
        EXPECT_FALSE(session.run().safety & frame_late) << i;
      }
    }
    session.run_for(0.03);
    EXPECT_TRUE(session.run().safety & frame_late) << ahead;
  }
}

TEST(Cycle, SaysWhetherAForceIsOut) {
  Session session;
  session.run_for(2.0);
  const CycleStatistics& statistics = session.cycle.statistics();
  EXPECT_FALSE(statistics.force_out);
  session.press_to(-0.002);
  EXPECT_TRUE(statistics.force_out);
  session.device.hand.position.z() = 0.02;
  session.run_for(0.1);
  EXPECT_FALSE(statistics.force_out);
}

// Hazard: late-loop
TEST(Cycle, SeatsTheProxyOnTheFreeSideAfterAStall) {
  // While the loop stood still for 50 ms the surface rose by 30 mm, past the proxy.
  Session session;
  session.run_for(2.0);
  session.press_to(-0.002);
  session.cloud = plane_at(0.03);
  session.next_frame = 0.0;
  const ServoTick record = session.run(0.05);
  EXPECT_TRUE(record.safety & stalled);
  EXPECT_TRUE(record.hand & proxy_reseated);
  EXPECT_GT(record.tick.proxy.z(), 0.03 + 4.8e-3);
  EXPECT_EQ(record.force.norm(), 0.0);
  EXPECT_LT(session.run().force.norm(), 0.01) << "and the force ramps up";
}

// A surface that swings by 4 mm at 14 Hz and carries a hand, with a force that lags.
struct SwingingSurface final : Method {
  explicit SwingingSurface(double known) : known_velocity(known) {}
  void seat(const Vec3&) noexcept override {}
  void observe(const Observation& /*seen*/) noexcept override {}
  Tick tick(const Vec3& hip, double t) noexcept override {
    const double phase = omega * t;
    Tick tick = free_tick(hip, t, -1);
    tick.proxy = hip + Vec3(0, 0, 0.01);
    tick.normal = Vec3::UnitZ();
    tick.surface_velocity = known_velocity * amplitude * omega * std::cos(phase);
    if (presses) tick.force.z() = std::max(-2.4 * std::sin(phase - 2e-3 * omega), 0.0);
    return tick;
  }
  void set_parameters(const Parameters&) noexcept override {}
  static constexpr double amplitude = 4e-3;                       // [m]
  static constexpr double omega = 2.0 * std::numbers::pi * 14.0;  // [1/s]
  double known_velocity;                                          // [-] share that the method knows
  bool presses = false;
};

TEST(Cycle, TellsTheSafetyChainHowTheSurfaceMoves) {
  // What moves with its surface is no oscillation; without that knowledge it looks like one.
  const auto is_cut = [](double known) {
    FakeDevice device;
    const auto surface = std::make_shared<SwingingSurface>(known);
    Cycle cycle(surface, device);
    auto reader = cycle.reader();
    std::uint32_t flags = 0;
    for (int i = 0; i < 4000; ++i) {
      const double t = i * ms;
      surface->presses = i > 2000;
      device.hand.position.z() = SwingingSurface::amplitude * std::sin(SwingingSurface::omega * t);
      if (i % 30 == 0) cycle.put_frame(plane_at(0.0), t, t);
      cycle.run({.t = t});
      ServoTick record{};
      EXPECT_TRUE(reader.try_pop(record));
      flags |= record.safety;
    }
    return (flags & energy_cut) != 0;
  };
  EXPECT_FALSE(is_cut(1.0));
  EXPECT_TRUE(is_cut(0.0));
}

// Hazard: late-loop
TEST(FreeSide, IsBeyondAllThatIsSeenAlongTheSightline) {
  Patch patch;
  std::vector<Vec3> points = flat_grid(0.01, 1.5e-3, 20);
  const std::vector<Vec3> upper = flat_grid(0.02, 1.5e-3, 20);
  points.insert(points.end(), upper.begin(), upper.end());
  const BruteForceCloud seen_from_above(points, Vec3(0, 0, 1));
  EXPECT_NEAR(free_side(seen_from_above, {0, 0, 0}, Vec3::Zero(), 5e-3, patch).z(), 0.025, 1e-6);
  const BruteForceCloud from_nowhere(points);
  EXPECT_NEAR(free_side(from_nowhere, {0, 0, 0}, Vec3::UnitZ(), 5e-3, patch).z(), 0.025, 1e-6);
  EXPECT_EQ(free_side(from_nowhere, {0, 0, 0}, Vec3::Zero(), 5e-3, patch), Vec3::Zero());
  EXPECT_EQ(free_side(seen_from_above, {0, 0, 0.03}, Vec3::Zero(), 5e-3, patch), Vec3(0, 0, 0.03))
      << "a proxy that is free stays";
  const BruteForceCloud seen_from_below_it(points, Vec3(0, 0, 0.012));
  EXPECT_NEAR(free_side(seen_from_below_it, {0, 0, 0}, Vec3::Zero(), 5e-3, patch).z(), 0.012, 1e-9)
      << "and no farther than the camera";
}

// Hazard: bad-settings
TEST(Cycle, AdoptsSettingsInTheNextCycleAndRefusesBadOnesAtTheDoor) {
  Session session;
  session.run_for(2.0);
  session.press_to(-0.003);
  ServoSettings settings;
  settings.parameters.coupling.stiffness = 100.0;
  session.cycle.set_settings(settings);
  const ServoTick record = session.run_for(0.1);
  EXPECT_NEAR(record.force.z(), 0.3, 0.02);
  settings.safety.max_force = -1.0;
  EXPECT_THROW(session.cycle.set_settings(settings), Error);
  settings = {};
  settings.parameters.proxy.r_1 = 1.0;
  EXPECT_THROW(session.cycle.set_settings(settings), Error);
  settings = {};
  settings.placement.workspace_scale = 0.0;
  EXPECT_THROW(session.cycle.set_settings(settings), Error);
  settings = {};
  settings.placement.world_from_device.linear() *= 2.0;
  EXPECT_THROW(session.cycle.set_settings(settings), Error);
  EXPECT_NEAR(session.run().force.z(), 0.3, 0.02);
}

TEST(Cycle, RefusesAFrameWithoutACloud) {
  Session session;
  EXPECT_THROW(session.cycle.put_frame(nullptr, 0.0, 0.0), Error);
}

TEST(Cycle, CountsWhatItDid) {
  Session session;
  session.run_for(2.0);
  session.press_to(-0.002);
  const CycleStatistics& statistics = session.cycle.statistics();
  EXPECT_EQ(statistics.ticks, static_cast<std::uint64_t>(session.device.writes));
  EXPECT_EQ(statistics.interventions[6], 1U) << "disengaged once, at the start";
}

// Hazard: another-hand
TEST(LinkedHands, CallTicksThatStayAwayTroubleOnlyWhereAClockDrivesThem) {
  CycleStatistics hand;
  const double never = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(is_in_trouble(hand, 5.0, never)) << "its first tick is yet to come";
  EXPECT_TRUE(is_in_trouble(hand, 5.0, 0.01));
  EXPECT_TRUE(is_in_trouble(hand, 0.005, 0.01)) << "wherever the clock began";
  hand.ticks = 1;
  hand.last_t = 4.995;
  EXPECT_FALSE(is_in_trouble(hand, 5.0, 0.01));
  EXPECT_TRUE(is_in_trouble(hand, 5.006, 0.01));
  EXPECT_FALSE(is_in_trouble(hand, 5.006, never));
  for (const std::uint32_t flag : {stalled, frame_late, frame_lost, disengaged, ramping}) {
    hand.safety = flag;
    EXPECT_FALSE(is_in_trouble(hand, 5.0, 0.01)) << flag;
  }
  hand.safety = fault_latched;
  EXPECT_TRUE(is_in_trouble(hand, 5.0, 0.01));
  hand.safety = 0;
  const auto fault = [](DeviceFault of) {
    return static_cast<std::uint32_t>(of) << hand_fault_shift | hand_fault;
  };
  hand.hand = fault(DeviceFault::disconnected);
  EXPECT_TRUE(is_in_trouble(hand, 5.0, 0.01));
  hand.hand = fault(DeviceFault::another_hand);
  EXPECT_FALSE(is_in_trouble(hand, 5.0, 0.01)) << "or two hands would hold each other for ever";
}

// Hazard: another-hand
TEST(LinkedHands, StopOneAnotherAndKeepTheirOwnFaults) {
  Session session;
  const auto other = std::make_shared<CycleStatistics>();
  session.cycle.link({other}, std::numeric_limits<double>::infinity());
  session.run_for(0.5);
  EXPECT_GT(session.press_to(-0.002).force.z(), 0.5);
  other->safety = fault_latched;
  EXPECT_EQ(fault_of(session.run().hand), DeviceFault::another_hand);
  EXPECT_TRUE(session.run_for(1.0).force.isZero(0.0));
  session.device.hand.fault = DeviceFault::disconnected;
  EXPECT_EQ(fault_of(session.run().hand), DeviceFault::disconnected);
}

TEST(Cycle, NeitherAllocatesNorReleasesMemory) {
  if (!test::memory_is_counted) GTEST_SKIP() << "sanitizers bring their own new and delete";
  const test::MemoryCalls calls;
  ::operator delete(::operator new(sizeof(int)));  // a new expression could be optimised away
  ASSERT_EQ(calls.count(), 2U) << "or else nothing is counted";

  // A depth image, an unorganised cloud and a set of both, moving; settings change on the way.
  auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = 64, .height = 48, .fx = 60, .fy = 60, .cx = 31.5, .cy = 23.5});
  Eigen::Isometry3d looking_down = Eigen::Isometry3d::Identity();
  looking_down.linear() = Vec3(1, -1, -1).asDiagonal();
  looking_down.translation() = Vec3(0, 0, 0.1);
  const auto image = [&] {
    return std::make_shared<const DepthImage>(rays, std::vector<std::uint16_t>(64 * 48, 100),
                                              1000.0, looking_down);
  };
  Session session;
  std::uint64_t inside = 0;
  const auto measured = [&] {
    const test::MemoryCalls calls_inside;
    session.cycle.run({.t = session.t});
    inside += calls_inside.count();
  };
  std::uint64_t contacts = 0;
  ServoTick record{};
  for (int i = 0; i < 4000; ++i) {
    session.t += i % 1000 == 999 ? 0.02 : ms;
    if (i % 33 == 0) {
      const double z = 0.002 * std::sin(i * ms);
      switch ((i / 33) % 3) {
        case 0:
          session.cycle.put_frame(image(), session.t, session.t);
          break;
        case 1:
          session.cycle.put_frame(plane_at(z), session.t, session.t);
          break;
        default:
          session.cycle.put_frame(
              std::make_shared<CloudSet>(
                  std::vector<std::shared_ptr<const Cloud>>{image(), plane_at(z)}),
              session.t, session.t);
      }
    }
    if (i % 500 == 0) session.cycle.set_settings({});
    session.device.hand.position = {0.01 * std::sin(3 * i * ms), 0, 0.01 * std::cos(i * ms)};
    measured();
    ASSERT_TRUE(session.reader.try_pop(record));
    if (record.tick.state != ContactState::free_motion) ++contacts;
  }
  EXPECT_EQ(inside, 0U);
  EXPECT_GT(contacts, 500U) << "it must have touched all of that";
}

// Hazard: method-switched
TEST(Cycle, GoesOnWithAnotherMethodWhereTheOldOneWas) {
  Session session;
  session.run_for(2.0);
  const ServoTick before = session.press_to(-0.001);
  const std::uint64_t settings =
      session.cycle.command([](ServoCommands&) {}, make_method("paper")).number;
  const test::MemoryCalls calls;
  session.cycle.run({.t = session.t += ms});
  EXPECT_EQ(calls.count(), 0U);
  ServoTick record{};
  ASSERT_TRUE(session.reader.try_pop(record));
  EXPECT_NE(record.hand & method_switched, 0U);
  EXPECT_EQ(record.settings_number, settings);
  EXPECT_EQ(record.frame_number, before.frame_number);
  EXPECT_EQ(record.tick.frame, 0);  // of the new one
  EXPECT_EQ(record.tick.state, before.tick.state);
  EXPECT_NEAR(record.tick.force.z(), before.tick.force.z(), 0.05);
  EXPECT_LT((record.tick.proxy - before.tick.proxy).norm(), 1e-4);
  EXPECT_EQ(session.run().hand & method_switched, 0U);
}

// A hand at rest, pressed into a plane that rises at 50 mm/s; the force of the last tick.
Vec3 press_while_methods_change(const std::vector<std::string>& names) {
  test::FakeDevice device;
  Cycle cycle(make_method(names.front()), device);
  auto reader = cycle.reader();
  std::vector<std::shared_ptr<const Cloud>> planes;
  ServoTick record{};
  for (int i = 0; i < 2000; ++i) {
    const double t = 1e-3 * i;
    const bool rises = i < 1000;
    const double height = 0.05 * (rises ? t : 1.0) - 0.06;
    if (i % 33 == 0) {
      planes.push_back(std::make_shared<PointCloud>(test::flat_grid(height), Vec3(0, 0, 1)));
      cycle.put_frame(planes.back(), t, t);
    }
    const std::size_t phase = rises ? 0 : static_cast<std::size_t>(i - 1000) / 300;
    if (i >= 1000 && (i - 1000) % 300 == 0 && phase < names.size()) {
      ServoSettings settings;
      settings.method = names[phase];
      cycle.command([&](ServoCommands& told) { told.settings = settings; },
                    make_method(settings.method));
    }
    device.hand.position = Vec3(0, 0, rises ? height + 0.02 - 0.025 * t : -0.015);
    cycle.run({.t = t});
    static_cast<void>(reader.try_pop(record));
  }
  return record.tick.force;
}

// Hazard: method-switched
TEST(Cycle, SwitchesMethodsWithoutLeavingOneOnesVelocityToTheNext) {
  // A surface at rest gives the same force whichever methods came before.
  const double alone = press_while_methods_change({"sight"}).z();
  EXPECT_NEAR(press_while_methods_change({"paper", "sight"}).z(), alone, 0.1);
  EXPECT_NEAR(press_while_methods_change({"paper", "sight", "paper", "sight"}).z(), alone, 0.1);
  const double papers = press_while_methods_change({"paper"}).z();
  EXPECT_NEAR(press_while_methods_change({"sight", "paper"}).z(), papers, 0.1);
}

}  // namespace test_cycle
}  // namespace palpate
