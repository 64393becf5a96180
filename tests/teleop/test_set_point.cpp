// SPDX-License-Identifier: Apache-2.0
// Where a robot is sent: out of the way of what comes, no harder than it may press, never into a
// forbidden region.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/net/teleop/approach_watch.hpp"
#include "palpate/net/teleop/robot.hpp"
#include "palpate/net/teleop/set_point.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_set_point {

constexpr double tick = 1e-3;  // [s]
const Vec3 up = Vec3::UnitZ();

// On a surface below, or in free space.
ServoTick at(const Vec3& place, bool touches, double t) {
  ServoTick record;
  record.place = record.tick.proxy = record.tick.hip = place;
  record.tick.t = t;
  record.tick.state = touches ? ContactState::contact : ContactState::free_motion;
  if (touches) record.tick.normal = up;
  return record;
}

class SetPointTest : public ::testing::Test {
 protected:
  SetPoint::Order run(SetPoint& point, ServoTick record, double seconds, const Approach& comes = {},
                      const Vec3& force = Vec3::Zero(), const Vec3& press = Vec3::Zero()) {
    SetPoint::Order order;
    for (const double end = t_ + seconds; t_ < end; t_ += tick) {
      record.tick.t = t_;
      order = point.next(record, press, true, comes, force);
      EXPECT_TRUE(order.position.allFinite());
    }
    return order;
  }
  double t_ = 10.0;
};

TEST_F(SetPointTest, IsTheProxyWhereNothingElseIs) {
  SetPoint point;
  const Vec3 place(0.01, -0.02, 0.03);
  const SetPoint::Order order = run(point, at(place, false, t_), 0.1);
  EXPECT_EQ(order.position, place);
  EXPECT_EQ(order.velocity, Vec3::Zero());
}

// Hazard: robot-struck
TEST_F(SetPointTest, GoesAheadOfASurfaceThatComesAndNotAfterOneThatGoes) {
  SetPoint point({.lag = 0.08});
  ServoTick record = at(Vec3::Zero(), true, t_);
  record.tick.surface_velocity = 0.05;
  EXPECT_GE(run(point, record, 0.2).position.z(), 0.05 * 0.08);
  record.tick.surface_velocity = -0.05;
  // It stays away by what may come back in the robot's lag, after 0.2 s in which nobody sees it.
  EXPECT_LE(run(point, record, 0.5).position.z(), 0.05 * (0.08 + 0.2));
}

// Hazard: robot-struck
TEST_F(SetPointTest, IsOutOfTheWayBeforeWhatComesTouches) {
  SetPoint point({.tool_radius = 5e-3, .margin = 1e-3, .lag = 0.08});
  const ServoTick record = at(Vec3::Zero(), false, t_);
  // 20 mm away, at 60 mm/s: 15 mm of room less 1 mm are gone in 0.23 s.
  const Approach comes{.speed = 0.06, .gap = 0.02, .place = Vec3::Zero(), .away = up, .stamp = t_};
  EXPECT_EQ(run(point, record, 0.02, comes).position, Vec3::Zero());
  const SetPoint::Order order = run(point, record, 0.18, comes);
  const double surface = -0.02 + 0.06 * (t_ - comes.stamp);
  EXPECT_GT(order.position.z() - surface, 5e-3 + 1e-3 + 0.06 * 0.08);
  EXPECT_GT(order.velocity.z(), 0.0);
  // An old sight is no sight.
  run(point, record, 1.0, comes);
  EXPECT_NEAR(run(point, record, 0.01, comes).position.z(), 0.0, 1e-9);
}

// Hazard: robot-presses
TEST_F(SetPointTest, PressesByAShareOfTheForceIfTheRobotsStiffnessIsKnown) {
  const ServoTick record = at(Vec3::Zero(), true, t_);
  const Vec3 press(0.0, 0.0, -2.0);
  SetPointOptions options{.margin = 1e-3, .stiffness = 1000.0, .press_share = 0.5};
  SetPoint point(options);
  // Through the margin, and 1 N deep.
  EXPECT_NEAR(run(point, record, 2.0, {}, Vec3::Zero(), press).position.z(), -1e-3 - 1e-3, 1e-5);
  // No harder than it may.
  EXPECT_NEAR(run(point, record, 2.0, {}, Vec3::Zero(), 100.0 * press).position.z(), -1e-3 - 5e-3,
              1e-5);
  options.stiffness.reset();
  SetPoint unknown(options);
  EXPECT_EQ(run(unknown, record, 2.0, {}, Vec3::Zero(), press).position, Vec3::Zero());
}

// Hazard: robot-presses
TEST_F(SetPointTest, GivesWayToWhatPushesTooHard) {
  SetPoint point({.max_force = 5.0});
  const ServoTick record = at(Vec3::Zero(), false, t_);
  EXPECT_EQ(run(point, record, 0.5, {}, Vec3(0.9, 0.0, 0.0)).position, Vec3::Zero());
  const SetPoint::Order away = run(point, record, 0.5, {}, Vec3(8.0, 0.0, 0.0));
  EXPECT_GT(away.position.x(), 0.01);
  EXPECT_LT(run(point, record, 5.0).position.x(), 1e-3);
}

// Hazard: robot-presses
TEST_F(SetPointTest, GivesWayToWhatNobodyWantedToPress) {
  const Vec3 push(0.0, 0.0, 3.0);
  SetPoint unwanted({.stiffness = 1000.0, .press_share = 1.0});
  const ServoTick record = at(Vec3::Zero(), true, t_);
  EXPECT_GT(run(unwanted, record, 0.3, {}, push).position.z(), 5e-3);
  SetPoint wanted({.margin = 0.0, .stiffness = 1000.0, .press_share = 1.0});
  EXPECT_NEAR(run(wanted, record, 1.0, {}, push, -push).position.z(), -3e-3, 1e-6);
}

// Hazard: robot-collides
TEST_F(SetPointTest, StaysFartherFromWhatIsSeenWithNoiseAndFromWhatMovedLately) {
  ServoTick record = at(Vec3::Zero(), true, t_);
  SetPoint noisy;
  EXPECT_NEAR(run(noisy, record, 1.0, {.noise = 1e-3}).position.z(), 2e-3, 1e-6);
  EXPECT_LE(run(noisy, record, 1.0, {.noise = 0.1}).position.z(), 20e-3);
  // What is said to come, and does not: in the robot's lag.
  SetPoint misled({.lag = 0.08});
  EXPECT_NEAR(run(misled, record, 1.0, {.speed = 0.05, .stamp = -1.0}).position.z(), 4e-3, 1e-6);
  // A surface that goes, and may turn.
  SetPoint moved({.lag = 0.08});
  record.tick.surface_velocity = -0.05;
  run(moved, record, 0.5);
  record.tick.surface_velocity = 0.0;
  EXPECT_GT(run(moved, record, 0.5).position.z(), 8e-3);
  EXPECT_LT(run(moved, record, 10.0).position.z(), 0.1e-3);
  // Who wants to press is let through all that.
  SetPoint pressing({.margin = 1e-3, .stiffness = 1000.0, .press_share = 1.0});
  EXPECT_NEAR(run(pressing, record, 2.0, {.noise = 1e-3}, Vec3::Zero(), -2.0 * up).position.z(),
              -3e-3, 1e-5);
}

TEST_F(SetPointTest, FollowsAFallingProxySlowlyAndARisingOneAtOnce) {
  SetPoint point;
  run(point, at(Vec3::Zero(), true, t_), 0.1);
  const ServoTick fallen = at(Vec3(0.0, 0.0, -0.01), true, t_);
  EXPECT_NEAR(run(point, fallen, 0.04).position.z(), -0.05 * 0.04, 0.1e-3);
  // Nor fast when the contact is lost with it, as it is below a surface that is not seen.
  const ServoTick lost = at(Vec3(0.0, 0.0, -0.02), false, t_);
  EXPECT_GT(run(point, lost, 0.02).position.z(), -0.004);
  EXPECT_NEAR(run(point, at(Vec3::Zero(), true, t_), 0.01).position.z(), 0.0, 1e-6);
  // A normal that points away from what pushes the tool is believed slowly.
  ServoTick behind = at(Vec3(0.0, 0.0, -0.01), true, t_);
  behind.tick.normal = -up;
  EXPECT_GT(run(point, behind, 0.02, {}, 0.5 * up).position.z(), -0.0015);
}

TEST_F(SetPointTest, BelievesANormalThatTurnsRoundSlowly) {
  SetPoint point({.margin = 2e-3});
  ServoTick record = at(Vec3::Zero(), true, t_);
  EXPECT_NEAR(run(point, record, 1.0, {.noise = 5e-3}).position.z(), 0.01, 1e-5);
  record.tick.normal = Vec3(0.0, -0.8, -0.6);  // from the back of what is touched
  EXPECT_GT(run(point, record, 0.04, {.noise = 5e-3}).position.z(), 0.01 - 0.05 * 0.045);
  record.tick.normal = up;
  EXPECT_NEAR(run(point, record, 0.1, {.noise = 5e-3}).position.z(), 0.01, 1e-3);
  // A corner that is gone round is no turn of that kind.
  record.tick.normal = Vec3(0.8, 0.0, 0.6);
  EXPECT_GT(run(point, record, 0.02, {.noise = 5e-3}).position.x(), 3e-3);
}

TEST_F(SetPointTest, LostProxiesAreWhereTheToolIs) {
  SetPoint point;
  run(point, at(Vec3::Zero(), true, t_), 0.5);
  const ServoTick lost = with_proxy_at(Vec3(0.0, 0.0, 0.01), at(Vec3(0.0, 0.0, -0.05), true, t_));
  EXPECT_EQ(lost.tick.state, ContactState::free_motion);
  EXPECT_NEAR(point.next(lost, Vec3::Zero(), false, {}, Vec3::Zero()).position.z(), 0.01, 1e-9);
}

TEST_F(SetPointTest, GoesOutOfTheWayOfNothingIntoWhatIsTouched) {
  SetPoint point;
  const ServoTick record = at(Vec3::Zero(), true, t_);
  run(point, record, 0.1);
  // Seen from the wrong side: the tool is in the surface.
  const auto comes = [&](const Vec3& away) {
    return Approach{.speed = 0.05, .gap = 1e-3, .place = Vec3::Zero(), .away = away, .stamp = t_};
  };
  EXPECT_GE(run(point, record, 0.1, comes(-up)).position.z(), 0.0);
  const SetPoint::Order out = run(point, record, 0.1, comes(up));
  EXPECT_GT(out.position.z(), 5e-3);
  // It is out of the way at once, and comes back slowly.
  EXPECT_GT(run(point, record, 0.02).position.z(), out.position.z() - 0.002);
}

// Hazard: robot-runaway
TEST_F(SetPointTest, TurnsAsTheProxyAtTheSpeedOfItsFarthestPoint) {
  SetPoint point({.lever = 0.2, .max_speed = 0.5, .contact_speed = 0.05});
  ServoTick record = at(Vec3::Zero(), true, t_);
  const auto angle = [](const Rotation& a) { return rotation_vector(a).norm(); };
  EXPECT_EQ(angle(run(point, record, 0.1).orientation), 0.0);
  record.tick.proxy_orientation = rotation_by({1.0, 0.0, 0.0});
  const Rotation turned = run(point, record, 0.2).orientation;
  EXPECT_NEAR(angle(turned), 0.05 / 0.2 * 0.2, 1e-3);
  // A proxy that is none holds it.
  record.tick.proxy_orientation.w() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NEAR(angle(between(run(point, record, 1.0).orientation, turned)), 0.0, 1e-9);
  // In the open it is faster, no more than the robot.
  record.tick.proxy_orientation = rotation_by({3.0, 0.0, 0.0});
  record.tick.state = ContactState::free_motion;
  run(point, record, 0.45);
  const double before = angle(run(point, record, tick).orientation);
  EXPECT_NEAR(angle(run(point, record, 0.1).orientation) - before, 0.5 / 0.2 * 0.1, 0.01);
  // A stop takes the tool's orientation at once.
  EXPECT_NEAR(angle(point
                        .next(with_proxy_at(Vec3::Zero(), at(Vec3::Zero(), false, t_),
                                            rotation_by({0.1, 0.0, 0.0})),
                              Vec3::Zero(), false, {}, Vec3::Zero())
                        .orientation),
              0.1, 1e-9);
}

// Hazard: robot-collides
TEST_F(SetPointTest, NeverGoesIntoAForbiddenRegion) {
  Fixture wall;
  wall.name = "wall";
  wall.shape = FixtureShape::half_space;
  wall.world_from_fixture = Eigen::AngleAxisd(std::numbers::pi, Vec3::UnitX());  // above z = 0
  SetPoint point({.fixtures = robot_fixtures(FixtureSet({wall}))});
  const ServoTick record = at(Vec3(0.0, 0.0, -0.001), false, t_);
  Vec3 highest = Vec3::Constant(-1.0);
  for (int i = 0; i < 100; ++i) {
    const Approach comes{
        .speed = 0.2, .gap = 0.01, .place = record.place, .away = up, .stamp = t_ - 0.1};
    highest = highest.cwiseMax(run(point, record, 0.005, comes, Vec3(0.0, 0.0, 50.0)).position);
  }
  EXPECT_LE(highest.z(), 1e-6);
}

// Hazard: robot-collides
TEST_F(SetPointTest, TheRegionsOfARobotDoNotGiveWay) {
  Fixture box;
  box.name = "box";
  box.size = Vec3::Constant(0.1);
  Fixture guide = box;
  guide.name = "guide";
  guide.kind = FixtureKind::guide;
  guide.shape = FixtureShape::point;
  const auto regions = robot_fixtures(FixtureSet({box, guide}));
  ASSERT_EQ(regions->items().size(), 1U);
  EXPECT_EQ(regions->items()[0].fixture.numbers.give_way, 1.0);
}

TEST_F(SetPointTest, RefusesWhatCannotBe) {
  EXPECT_TRUE(test::fails_saying([] { SetPoint({.margin = -1.0}); }, "margin", "-1", "m"));
  EXPECT_TRUE(test::fails_saying([] { SetPoint({.press_share = 2.0}); }, "press_share", "2", ""));
}

// A plane that comes at 60 mm/s from 3 s on, or rests, before a noisy stereo camera.
TEST(ForceZeroTest, TakesOffWhatIsMeasuredInFreeSpaceAndNoContact) {
  ForceZero zero;
  const Vec3 weight(0.5, 0.0, -6.0);
  double t = 3.0;
  const auto run = [&](double seconds, const Vec3& force, bool free) {
    Vec3 left = Vec3::Zero();
    for (const double end = t + seconds; t < end; t += tick) left = zero.next(t, force, free);
    return left;
  };
  // Before anything was free, all is told as it is.
  EXPECT_EQ(run(0.1, weight, false), weight);
  EXPECT_LT(run(1.0, weight, true).norm(), 1e-9);
  // A contact counts, with what is seen and with what is not; afterwards nothing is left of it.
  const Vec3 push(0.0, 0.0, 3.0);
  EXPECT_LT((run(5.0, weight + push, false) - push).norm(), 1e-9);
  EXPECT_LT((run(5.0, weight + push, true) - push).norm(), 1e-9);
  EXPECT_LT(run(0.01, weight, true).norm(), 1e-9);
  // Drift.
  EXPECT_LT(run(10.0, weight + 0.2 * push, true).norm(), 0.01);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(run(0.01, Vec3::Constant(nan), true).allFinite());
  EXPECT_LT(run(0.01, weight + 0.2 * push, true).norm(), 0.01);
}

std::vector<Approach> watched(const char* motion, double seconds, const Vec3& tool) {
  const auto camera = open_synthetic_camera(
      Uri("synthetic:plane?size=160x160&fov=15.5deg&distance=0.7m&sensor=d4xx&seed=3" +
          std::string(motion)));
  ApproachWatch watch;
  std::vector<Approach> all;
  for (int i = 0; i < static_cast<int>(30.0 * seconds); ++i) {
    const double t = i / 30.0;
    all.push_back(watch.frame(camera->capture(t, static_cast<std::uint64_t>(i)).cloud, t, tool));
  }
  return all;
}

// Hazard: robot-struck
TEST(ApproachWatchTest, SeesWhatComesWithinSevenFrames) {
  const std::vector<Approach> seen = watched("&speed=0.06&start=2", 2.5, {0.0, 0.0, 0.03});
  int late = 0;
  for (std::size_t i = 60 + 7; i < seen.size(); ++i) {
    late += seen[i].speed == 0.0;
    if (seen[i].speed == 0.0) continue;
    EXPECT_GT(seen[i].speed, 0.03);
    EXPECT_LT(seen[i].speed, 0.12);
    EXPECT_GT(seen[i].away.z(), 0.9);
    const double true_gap = 0.03 - 0.06 * (static_cast<double>(i) / 30.0 - 2.0);
    EXPECT_NEAR(seen[i].gap, std::max(true_gap, 0.0), 4e-3);
  }
  EXPECT_LE(late, 1);
}

// Hazard: robot-struck
TEST(ApproachWatchTest, IsSeldomWrongAboutWhatRests) {
  const std::vector<Approach> seen = watched("", 20.0, {0.0, 0.0, 0.03});
  const auto wrong =
      std::count_if(seen.begin(), seen.end(), [](const Approach& one) { return one.speed > 0.0; });
  EXPECT_LE(wrong, 30);  // of 600
}

// Hazard: robot-struck
TEST(ApproachWatchTest, BeginsAnewWhereTimeDoesAndSaysNothingOfNothing) {
  const auto camera = open_synthetic_camera(Uri("synthetic:plane?size=64x48&noise=1mm"));
  ApproachWatch watch;
  for (const double t : {1.0, 1.1, 1.2, 1.3, 0.5, 0.6})
    EXPECT_EQ(watch.frame(camera->capture(t, 1).cloud, t, {0.0, 0.0, 0.03}).speed, 0.0);
  EXPECT_EQ(watch.frame(camera->capture(0.7, 2).cloud, 0.7, {0.0, 0.0, 5.0}).speed, 0.0);
}

// A ball of 60 mm whose top is the origin, 40 mm above a floor.
// Hazard: robot-struck
TEST(ApproachWatchTest, SeesWhatIsBetweenAToolAndItsProxy) {
  constexpr double radius = 0.005;  // [m]
  const auto camera =
      open_synthetic_camera(Uri("synthetic:sphere?radius=30mm&floor=100mm&size=320x240&fov=40deg&"
                                "distance=0.7m&sensor=d4xx"));
  ApproachWatch watch;
  double t = 1.0;
  const auto between = [&](const Vec3& proxy, const Vec3& tool) {
    t += 0.02;
    return watch.is_between(proxy, tool, radius, t);
  };
  const Vec3 above(0.0, 0.0, 0.03);
  const Vec3 below(0.0, 0.0, -0.08);
  EXPECT_FALSE(between(below, above)) << "nothing has been seen";
  watch.frame(camera->capture(t, 1).cloud, t, above);
  EXPECT_TRUE(between(below, above));
  EXPECT_TRUE(between({0.01, 0.0, -0.03}, above)) << "in the ball";
  EXPECT_FALSE(between({0.0, 0.0, 0.006}, above)) << "on its way to the ball";
  EXPECT_FALSE(between({0.09, 0.0, 0.03}, above)) << "beside it";
  EXPECT_FALSE(between(below, {0.08, 0.0, -0.08})) << "from the side into its shadow";
  EXPECT_FALSE(between(above, {0.0, 0.0, -0.02})) << "out of the ball";
}

TEST(SimulatedToolTest, IsLateByItsLagAndDoesNotOvershoot) {
  const auto nothing = [](const Vec3&, double) { return SimulatedTool::Surface{1.0, up}; };
  SimulatedTool tool(Vec3::Zero(), nothing);
  constexpr double speed = 0.1;
  double t = 0.0;
  for (; t < 1.0; t += tick) tool.lead_to(speed * t * up, t + tick, tick);
  EXPECT_NEAR(speed * t - tool.place().z(), speed * SimulatedTool::lag(), 2e-4);
  const double end = speed * t;
  for (; t < 2.0; t += tick) {
    tool.lead_to(end * up, t + tick, tick);
    ASSERT_LE(tool.place().z(), end + 1e-9);
  }
  EXPECT_NEAR(tool.place().z(), end, 1e-5);
}

}  // namespace test_set_point
}  // namespace palpate
