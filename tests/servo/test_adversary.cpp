// SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "tests/servo/adversary.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace test_adversary {

// Of both hands together; more, until both had something at stake, but no more than these.
constexpr std::uint64_t ticks = test::sanitized ? 50'000 : 400'000, most_ticks = 1'000'000;

// Whether this hand felt forces and torques, by a ball and a tool, for long enough that a broken
// promise would show.
bool had_something_at_stake(const test::Adversary& hand) {
  return hand.strongest() > 3.0 && hand.strongest_torque() > 0.09 &&
         hand.forceful_ticks() > ticks / 100 && hand.turning_ticks() > ticks / 400 &&
         hand.tool_ticks() > 0;
}

// The same for longer: `ninja adversarial_ticks`.
// Hazard: too-much-force, torque, another-hand
TEST(Adversary, GetsNoForceThatBreaksAPromise) {
  test::Adversary hands[] = {test::Adversary(1), test::Adversary(2)};
  test::Adversary::link(hands[0], hands[1]);
  const auto enough = [&] {
    return had_something_at_stake(hands[0]) && had_something_at_stake(hands[1]);
  };
  while (hands[1].ticks() < ticks / 2 || (hands[1].ticks() < most_ticks / 2 && !enough())) {
    for (test::Adversary& hand : hands) {
      const std::string broken = hand.step();
      ASSERT_TRUE(broken.empty()) << broken;
    }
  }
  EXPECT_TRUE(enough());
}

}  // namespace test_adversary
}  // namespace palpate
