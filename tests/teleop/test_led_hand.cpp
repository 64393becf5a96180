// SPDX-License-Identifier: Apache-2.0
// What crosses the link, and how it is followed.
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/net/teleop/led_hand.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_led_hand {

constexpr double tick = 1e-3;  // [s]

double angle(const Rotation& a, const Rotation& b) { return rotation_vector(between(a, b)).norm(); }

ServoTick held_at(const Vec3& place) {
  ServoTick record;
  record.place = place;
  record.hand = hand_present;
  return record;
}

TEST(Lead, IsTheProxyWhileAHandIsThereAndSees) {
  ServoTick record = held_at({0.1, 0.2, 0.3});
  record.force = Vec3(0.0, 0.0, 2.0);
  const Lead lead = lead_of(record);
  EXPECT_TRUE(lead.leads);
  EXPECT_EQ(lead.place, record.place);
  EXPECT_EQ(lead.press, Vec3(0.0, 0.0, -2.0));

  const auto leads_with = [&](std::uint32_t hand, std::uint32_t safety) {
    ServoTick other = record;
    other.hand = hand;
    other.safety = safety;
    return lead_of(other).leads;
  };
  EXPECT_TRUE(leads_with(hand_present, disengaged | ramping | frame_fading | force_cut));
  EXPECT_FALSE(leads_with(0, 0));
  EXPECT_FALSE(leads_with(hand_present | hand_clutched, 0));
  EXPECT_FALSE(leads_with(hand_present | hand_fault, 0));
  for (const std::uint32_t blind : {frame_lost, fault_latched, output_refused})
    EXPECT_FALSE(leads_with(hand_present, blind));
  record.place.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(lead_of(record).leads);
}

// A hand that is pressed into a forbidden region leads to the region's border.
// Hazard: robot-collides
TEST(Lead, StaysOutOfForbiddenRegions) {
  Fixture wall;
  wall.name = "wall";
  wall.shape = FixtureShape::half_space;  // below z = 0
  LedHand hand({0.0, 0.0, 0.02}, {.max_speed = 1.0, .resume_time = 0.0});
  ServoSettings settings;
  settings.fixtures = std::make_shared<const FixtureSet>(std::vector{wall});
  Cycle cycle(make_method("sight"), hand, settings);
  auto ticks = cycle.reader();
  ServoTick record;
  for (int i = 0; i < 200; ++i) {
    const double t = 1.0 + i * tick;
    hand.lead({.place = {0.0, 0.0, -0.01}, .leads = true}, t);
    cycle.run({.t = t});
    ASSERT_TRUE(ticks.try_pop(record));
    ASSERT_GE(record.place.z(), -1e-6);
  }
  EXPECT_NEAR(record.tick.hip.z(), -0.01, 1e-9);
  EXPECT_NEAR(record.place.z(), 0.0, 1e-6);
}

TEST(Lead, TurnsAsTheHandleDoesInTheWorldAndNotAtAllWithoutAnOrientation) {
  ServoTick record = held_at(Vec3::Zero());
  const Rotation world_from_device = rotation_by({0.3, -0.2, 1.0});
  record.tick.orientation = record.tick.proxy_orientation = world_from_device;
  EXPECT_LT(angle(lead_of(record).turn, Rotation::Identity()), 1e-9);
  record.handle = rotation_by({0.5, 0.0, 0.0});
  record.tick.orientation = product(world_from_device, record.handle);
  // The proxy was held back by a surface.
  const Rotation turn = rotation_by({0.0, 0.0, 0.4});
  record.tick.proxy_orientation = product(turn, world_from_device);
  EXPECT_LT(angle(lead_of(record).turn, turn), 1e-9);
  EXPECT_TRUE(lead_of(record).leads);
  record.tick.proxy_orientation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(lead_of(record).leads);
}

class LedHandTest : public ::testing::Test {
 protected:
  // Reads for so long, led or not; the tool follows at once. @return the largest speed [m/s], of a
  // point 0.2 m from its centre as far as it turns
  double go(LedHand& hand, double seconds, const std::optional<Vec3>& to,
            const Rotation& turn = Rotation::Identity()) {
    double fastest = 0.0;
    for (const double end = t_ + seconds; t_ < end; t_ += tick) {
      if (to) hand.lead({.place = *to, .turn = turn, .leads = true}, t_);
      const Vec3 before = at_;
      const Rotation was = turn_;
      const HandState state = hand.read(t_);
      at_ = state.position;
      turn_ = Rotation(state.orientation.value());
      hand.tool_is_at(tool_.value_or(at_), tool_turn_.value_or(turn_));
      fastest = std::max(fastest, ((at_ - before).norm() + 0.2 * angle(turn_, was)) / tick);
    }
    return fastest;
  }

  double t_ = 100.0;
  Vec3 at_ = Vec3::Zero();
  Rotation turn_ = Rotation::Identity();
  std::optional<Vec3> tool_;           // where it is said to be; none: at the hand
  std::optional<Rotation> tool_turn_;  // likewise
};

// Hazard: robot-runaway
TEST_F(LedHandTest, FollowsAtALimitedSpeedAndSlowlyAtFirst) {
  LedHand hand(Vec3::Zero(), {.max_speed = 0.2, .contact_speed = 0.05, .resume_time = 0.5});
  const Vec3 far(1.0, 0.0, 0.0);
  EXPECT_LT(go(hand, 0.05, far), 0.03);
  EXPECT_NEAR(go(hand, 1.0, far), 0.2, 1e-6);
  hand.clearance(0.0);
  EXPECT_NEAR(go(hand, 0.2, far), 0.05, 1e-6);
  hand.clearance(0.01);
  EXPECT_NEAR(go(hand, 0.2, far), 0.1, 1e-6);
  hand.clearance(std::numeric_limits<double>::quiet_NaN());
  EXPECT_LE(go(hand, 0.2, far), 0.05 + 1e-6);
  hand.clearance(1.0);
  go(hand, 6.0, far);
  EXPECT_EQ(at_, far);
  EXPECT_TRUE(hand.is_led());
}

// Hazard: robot-runaway
TEST_F(LedHandTest, RestsWhereTheToolIsWithoutALead) {
  LedHand hand(Vec3::Zero(), {.max_speed = 0.2, .silence = 0.05, .resume_time = 0.1});
  go(hand, 1.0, Vec3(1.0, 0.0, 0.0));
  tool_ = at_ - Vec3(0.015, 0.0, 0.0);  // it is late
  go(hand, 0.04, std::nullopt);
  EXPECT_TRUE(hand.is_led());
  go(hand, 0.02, std::nullopt);
  EXPECT_FALSE(hand.is_led());
  EXPECT_EQ(at_, *tool_);
  // What pushes the tool afterwards does not lead it.
  const Vec3 rests = at_;
  tool_ = Vec3(0.0, 0.0, 0.5);
  go(hand, 1.0, std::nullopt);
  EXPECT_EQ(at_, rests);
}

// Hazard: robot-runaway
TEST_F(LedHandTest, IsNotLedWhileNothingIsSeenOrByWhatIsNoPlace) {
  LedHand hand(Vec3::Zero(), {});
  const Vec3 to(0.1, 0.0, 0.0);
  go(hand, 0.2, to);
  hand.sees(false);
  go(hand, 0.01, to);
  EXPECT_FALSE(hand.is_led());
  hand.sees(true);
  go(hand, 0.2, to);
  EXPECT_TRUE(hand.is_led());
  const Vec3 before = at_;
  go(hand, 0.2, Vec3(std::numeric_limits<double>::infinity(), 0.0, 0.0));
  EXPECT_FALSE(hand.is_led());
  EXPECT_EQ(at_, before);
  hand.tool_is_at(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_TRUE(hand.read(t_).position.allFinite());
}

// Hazard: robot-runaway
TEST_F(LedHandTest, TurnsNoFasterThanItsFarthestPointMayMove) {
  LedHand hand(Vec3::Zero(),
               {.max_speed = 0.2, .contact_speed = 0.05, .lever = 0.2, .resume_time = 0.5});
  const Rotation turn = rotation_by({0.0, 0.0, 3.0});
  EXPECT_LT(go(hand, 0.05, Vec3::Zero(), turn), 0.03);
  EXPECT_NEAR(go(hand, 1.0, Vec3::Zero(), turn), 0.2, 1e-6);
  hand.clearance(0.0);
  EXPECT_NEAR(go(hand, 0.2, Vec3::Zero(), turn), 0.05, 1e-6);
  hand.clearance(1.0);
  // With a way to go, both arrive together.
  const Vec3 to(0.1, 0.0, 0.0);
  const double left = angle(turn, turn_);
  EXPECT_NEAR(go(hand, 0.5, to, turn), 0.2, 1e-6);
  EXPECT_NEAR((to - at_).norm() / 0.1, angle(turn, turn_) / left, 1e-6);
  EXPECT_LT((to - at_).norm(), 0.09);
  go(hand, 5.0, to, turn);
  EXPECT_EQ(at_, to);
  EXPECT_LT(angle(turn_, turn), 1e-9);
}

// Hazard: robot-runaway
TEST_F(LedHandTest, HoldsTheToolsOrientationWithoutALeadAndComesBackSlowly) {
  LedHand hand(Vec3::Zero(), {.silence = 0.05, .resume_time = 0.5});
  const Rotation turn = rotation_by({2.0, 0.0, 0.0});
  go(hand, 0.8, Vec3::Zero(), turn);
  tool_turn_ = rotation_by({0.5, 0.0, 0.0});  // it is late
  ASSERT_GT(angle(turn_, *tool_turn_), 0.05);
  go(hand, 0.06, std::nullopt);
  EXPECT_FALSE(hand.is_led());
  EXPECT_LT(angle(turn_, *tool_turn_), 1e-9);
  tool_turn_ = rotation_by({0.0, 1.0, 0.0});  // by what pushes it
  go(hand, 1.0, std::nullopt);
  EXPECT_LT(angle(turn_, rotation_by({0.5, 0.0, 0.0})), 1e-9);
  EXPECT_LT(go(hand, 0.05, Vec3::Zero(), turn), 0.25 * 0.2 / 0.1 * 0.11);
}

// Hazard: robot-runaway
TEST_F(LedHandTest, RestsWhereAnOrientationIsNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Rotation& bad : {Rotation(1.0, nan, 0.0, 0.0), Rotation(0.0, 0.0, 0.0, 0.0),
                              Rotation(1.0, 1.0, 0.0, 0.0), Rotation(1e200, 0.0, 0.0, 0.0)}) {
    LedHand hand(Vec3::Zero(), {});
    go(hand, 0.3, Vec3(0.1, 0.0, 0.0), rotation_by({1.0, 0.0, 0.0}));
    EXPECT_TRUE(hand.is_led());
    const Vec3 before = at_;
    const Rotation was = turn_;
    hand.tool_is_at(at_, bad);
    go(hand, 0.3, Vec3(0.1, 0.0, 0.0), bad);
    EXPECT_FALSE(hand.is_led());
    EXPECT_LT((at_ - before).norm(), 1e-9);
    EXPECT_LT(angle(turn_, was), 1e-9);
    EXPECT_THROW(LedHand(Vec3::Zero(), {}, bad), Error);
    turn_ = Rotation::Identity();
  }
}

TEST_F(LedHandTest, TurnsNoToolOfARobotThatDoesNot) {
  const Rotation found = rotation_by({0.0, 1.0, 0.0});
  LedHand hand(Vec3::Zero(), {.turns = false}, found);
  go(hand, 1.0, Vec3(0.1, 0.0, 0.0), rotation_by({1.0, 0.0, 0.0}));
  tool_turn_ = rotation_by({0.0, 0.0, 1.0});
  go(hand, 0.5, std::nullopt);
  EXPECT_LT(angle(turn_, found), 1e-9);
}

TEST_F(LedHandTest, GoesWhereRegionsKeepTheProxy) {
  LedHand hand(Vec3::Zero(), {.resume_time = 0.0});
  const Vec3 in(0.0, 0.0, -0.02);
  const auto pushed = [&](double seconds) {
    for (int i = 0; i < seconds / tick; ++i) {
      hand.kept_out(Vec3(0.0, 0.0, std::max(-0.001 - at_.z(), 0.0)));  // z = -1 mm is a border
      go(hand, 0.5 * tick, in);
    }
  };
  hand.clearance(0.0);
  pushed(2.0);
  EXPECT_GT(at_.z(), -0.0015);
  // Nobody says so any more: it goes on.
  go(hand, 2.0, in);
  EXPECT_EQ(at_, in);
  hand.kept_out(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
  go(hand, 0.01, in);
  EXPECT_EQ(at_, in);
  // A single word counts once.
  hand.kept_out(Vec3(0.0, 0.0, 1.0));
  go(hand, 0.002, std::nullopt);
  EXPECT_LT((at_ - in).norm(), 0.45);
  go(hand, 20.0, in);
  EXPECT_EQ(at_, in);
}

// Hazard: robot-collides
TEST_F(LedHandTest, StaysWithinItsReach) {
  LeadLimits limits;
  limits.reach.emplace(Vec3(-0.1, -0.1, 0.0), Vec3(0.1, 0.1, 0.2));
  LedHand hand(Vec3(0.0, 0.0, 0.1), limits);
  go(hand, 5.0, Vec3(1.0, -1.0, 0.1));
  EXPECT_LT((at_ - Vec3(0.1, -0.1, 0.1)).norm(), 1e-9);
}

TEST_F(LedHandTest, RefusesWhatCannotBe) {
  EXPECT_TRUE(test::fails_saying([] { LedHand(Vec3::Zero(), {.max_speed = 0.0}); }, "max_speed",
                                 "m/s", ""));
  EXPECT_TRUE(
      test::fails_saying([] { LedHand(Vec3::Zero(), {.silence = 5.0}); }, "silence", "5", "s"));
  LeadLimits turned;
  turned.reach.emplace(Vec3::Ones(), Vec3::Zero());
  EXPECT_TRUE(
      test::fails_saying([&] { LedHand(Vec3::Zero(), turned); }, "reach", "no box", "corner"));
}

// Hazard: robot-runaway
TEST(LinkLimits, FadeWhenFramesAreOlderThanTheLinkMakesThem) {
  const SafetyParameters usual;
  const SafetyParameters near = for_link(usual, 0.0);
  EXPECT_EQ(near.fade_age, usual.fade_age);
  EXPECT_NEAR(near.lost_age, usual.fade_age + 0.3, 1e-12);
  const SafetyParameters far = for_link(usual, 0.25);
  EXPECT_NEAR(far.fade_age, usual.fade_age + 0.25, 1e-12);
  EXPECT_NEAR(far.lost_age - far.fade_age, 0.3, 1e-12);
  EXPECT_LE(for_link(usual, 60.0).fade_age, usual.fade_age + 1.0);
  validate(far);
}

}  // namespace test_led_hand
}  // namespace palpate
