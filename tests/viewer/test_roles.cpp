// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/net/viewer/roles.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_roles {

using test::fails_saying;

auto asking(const Command& command, Role role) {
  return [command, role] { check_allowed(command, role); };
}

// Hazard: strangers-limits
TEST(Roles, AllowALookingPageNothing) {
  for (const Command& command :
       {Command(SetParameter{"stiffness", 1.0}), Command(SetSafetyParameter{"max_speed", 0.1}),
        Command(SetPlacement{"scale", 2.0}), Command(SetMethod{"paper"}),
        Command(SetRecording{true}), Command(SetRecording{false}), Command(ResetHand{}),
        Command(ResetFaults{}), Command(SetPlayback{true, true, 1.0}), Command(Seek{0.5}),
        Command(OpenScene{"synthetic:desk"}), Command(Rescale{0.5}), Command(SetBrush{"ice", 0.01}),
        Command(DropBrush{}), Command(ClearPaint{}), Command(Forbid{0.1, 0.01}),
        Command(Guide{0.002}), Command(RemoveFixture{"wall"})}) {
    EXPECT_THROW(check_allowed(command, Role::looking), Error) << command.index();
    EXPECT_NO_THROW(check_allowed(command, Role::operating)) << command.index();
  }
}

// Hazard: strangers-limits
TEST(Roles, LeaveMethodPlacementAndRecordingToTheOperator) {
  EXPECT_TRUE(fails_saying(asking(SetMethod{"paper"}, Role::holding), "operator"));
  EXPECT_TRUE(fails_saying(asking(SetTool{"ball"}, Role::holding), "tool", "operator"));
  EXPECT_TRUE(fails_saying(asking(SetPlacement{"scale", 2.0}, Role::holding), "operator"));
  EXPECT_TRUE(fails_saying(asking(SetRecording{true}, Role::holding), "operator"));
  EXPECT_TRUE(fails_saying(asking(SetRecording{false}, Role::holding), "operator"));
  EXPECT_TRUE(fails_saying(asking(SetPlayback{true, true, 1.0}, Role::holding), "operator"));
  EXPECT_TRUE(fails_saying(asking(Seek{0.5}, Role::holding), "operator"));
  EXPECT_TRUE(fails_saying(asking(Rescale{0.5}, Role::holding), "operator"));
  EXPECT_TRUE(fails_saying(asking(OpenScene{"synthetic:desk"}, Role::holding), "operator"));
  EXPECT_TRUE(fails_saying(asking(ResetFaults{}, Role::holding), "latched", "operator"));
  EXPECT_TRUE(fails_saying(asking(Forbid{0.1, 0.01}, Role::holding), "fixture", "operator"));
  EXPECT_TRUE(fails_saying(asking(Guide{0.002}, Role::holding), "fixture", "operator"));
  EXPECT_TRUE(fails_saying(asking(RemoveFixture{"wall"}, Role::holding), "operator"));
  EXPECT_NO_THROW(check_allowed(SetParameter{"stiffness", 1.0}, Role::holding));
  EXPECT_NO_THROW(check_allowed(SetSafetyParameter{"max_speed", 0.1}, Role::holding));
  EXPECT_NO_THROW(check_allowed(ResetHand{}, Role::holding));
  EXPECT_NO_THROW(check_allowed(SetBrush{"ice", 0.01}, Role::holding));
}

// Hazard: strangers-limits
TEST(LimitBounds, LetWhoHoldsTheHandMakeEveryLimitStricterAndNoneLooser) {
  const SafetyParameters start;
  const LimitBounds bounds(start);
  for (const SafetyParameterInfo& row : safety_parameter_table()) {
    const Stricter stricter = stricter_direction(row.name);
    const double now = row.get(start);
    const auto allowed = [&](double value) {
      try {
        bounds.check(row.name, value, Role::holding);
        return true;
      } catch (const Error&) {
        return false;
      }
    };
    EXPECT_EQ(allowed(now), stricter != Stricter::neither) << row.name;
    EXPECT_EQ(allowed(row.min), stricter == Stricter::lower) << row.name;
    EXPECT_EQ(allowed(row.max), stricter == Stricter::higher) << row.name;
    EXPECT_EQ(allowed(1.001 * now + 1e-9), stricter == Stricter::higher) << row.name;
    EXPECT_NO_THROW(bounds.check(row.name, row.max, Role::operating)) << row.name;
    EXPECT_NO_THROW(bounds.check(row.name, row.min, Role::operating)) << row.name;
    EXPECT_THROW(bounds.check(row.name, row.min, Role::looking), Error) << row.name;
  }
}

// Hazard: strangers-limits
TEST(LimitBounds, FollowTheOperatorBothWays) {
  LimitBounds bounds{SafetyParameters{}};
  const auto force = [&](double newtons) {
    return [&bounds, newtons] { bounds.check("max_device_force", newtons, Role::holding); };
  };
  EXPECT_TRUE(fails_saying(force(50.0), "50 N", "3.3 N", "operator"));
  bounds.set_by_operator("max_device_force", 1.0);
  EXPECT_TRUE(fails_saying(force(2.0), "1 N"));
  bounds.set_by_operator("max_device_force", 5.0);
  EXPECT_NO_THROW(force(4.5)());
}

// Hazard: strangers-limits
TEST(LimitBounds, EndWhereTheSessionsOptionsEndThem) {
  const LimitBounds bounds(SafetyParameters{}, {{"max_device_force", 4.0}, {"ramp_time", 1.0}});
  EXPECT_NO_THROW(bounds.check("max_device_force", 4.0, Role::operating));
  EXPECT_TRUE(fails_saying([&] { bounds.check("max_device_force", 4.1, Role::operating); },
                           "4.1 N is above the 4 N"));
  EXPECT_NO_THROW(bounds.check("ramp_time", 9.0, Role::operating));
  EXPECT_TRUE(
      fails_saying([&] { bounds.check("ramp_time", 0.9, Role::operating); }, "below the 1 s"));
  const auto with = [](const std::string& name, double value) {
    return [name, value] { LimitBounds(SafetyParameters{}, {{name, value}}); };
  };
  EXPECT_TRUE(fails_saying(with("fall_rate", 100.0), "fall_rate"));
  EXPECT_TRUE(fails_saying(with("max_device_farce", 1.0), "max_device_force"));
  EXPECT_TRUE(fails_saying(with("max_device_force", 1e9), "max_device_force"));
}

TEST(Token, IsItselfAndNothingElse) {
  const std::string token = "abcdefgh-0123";
  EXPECT_TRUE(is_token(token, token));
  EXPECT_FALSE(is_token("", ""));
  EXPECT_FALSE(is_token(token, ""));
  EXPECT_FALSE(is_token("", token));
  for (std::size_t i = 0; i < token.size(); ++i) {
    std::string other = token;
    other[i] = 'x';
    EXPECT_FALSE(is_token(other, token)) << i;
    EXPECT_FALSE(is_token(token.substr(0, i), token)) << i;
  }
  EXPECT_FALSE(is_token(token + '\0', token));
  const std::string longest(longest_token, 'a');
  EXPECT_TRUE(is_token(longest, longest));
  EXPECT_FALSE(is_token(longest + "a", longest));
  EXPECT_FALSE(is_token(longest + "a", longest + "a"));
}

TEST(GuessLimit, PausesLongerAndLongerAfterEightWrongTokens) {
  GuessLimit limit;
  double t = 10.0;
  for (int i = 0; i < 8; ++i) limit.wrong("a", std::to_string(i), t);
  EXPECT_EQ(limit.pause("a", t), 0.0);
  std::vector<double> pauses;
  for (int i = 8; i < 20; ++i) {
    limit.wrong("a", std::to_string(i), t);
    pauses.push_back(limit.pause("a", t));
    t += pauses.back();
    EXPECT_EQ(limit.pause("a", t), 0.0);
  }
  EXPECT_EQ(pauses, (std::vector<double>{1, 2, 4, 8, 16, 32, 64, 128, 256, 300, 300, 300}));
  EXPECT_EQ(limit.pause("b", t), 0.0) << "others are not concerned";
  limit.wrong("a", "later", t + 1.1 * GuessLimit::memory);
  EXPECT_EQ(limit.pause("a", t + 1.1 * GuessLimit::memory), 0.0);
}

TEST(GuessLimit, CountsATokenThatComesAgainOnce) {
  GuessLimit limit;
  for (int i = 0; i < 1000; ++i) limit.wrong("a", "of yesterday's session", 2.0 * i);
  EXPECT_EQ(limit.pause("a", 2000.0), 0.0);
}

TEST(GuessLimit, RemembersOnlySoManyAddresses) {
  GuessLimit limit;
  const auto guess_often = [&](const std::string& address, double t) {
    for (int i = 0; i < 12; ++i) limit.wrong(address, std::to_string(i), t);
  };
  guess_often("first", 0.0);
  for (std::size_t i = 0; i + 1 < GuessLimit::max_addresses; ++i)
    limit.wrong(std::to_string(i), "x", 1.0);
  EXPECT_GT(limit.pause("first", 1.0), 0.0);
  limit.wrong("one more", "x", 1.0);
  EXPECT_EQ(limit.pause("first", 1.0), 0.0);
}

}  // namespace test_roles
}  // namespace palpate
