// SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "tests/servo/adversary.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace test_adversary {

constexpr std::uint64_t ticks = test::sanitized ? 50'000 : 400'000;

// The same for longer: `ninja adversarial_ticks`.
// Hazard: too-much-force, torque, another-hand
TEST(Adversary, GetsNoForceThatBreaksAPromise) {
  test::Adversary hands[] = {test::Adversary(1), test::Adversary(2)};
  test::Adversary::link(hands[0], hands[1]);
  while (hands[1].ticks() < ticks / 2) {
    for (test::Adversary& hand : hands) {
      const std::string broken = hand.step();
      ASSERT_TRUE(broken.empty()) << broken;
    }
  }
  for (const test::Adversary& hand : hands) {
    EXPECT_GT(hand.strongest(), 3.0) << "nothing was at stake";
    EXPECT_GT(hand.strongest_torque(), 0.09) << "nothing was at stake";
    EXPECT_GT(hand.forceful_ticks(), ticks / 100) << "nothing was at stake";
    EXPECT_GT(hand.turning_ticks(), ticks / 400) << "nothing was at stake";
    EXPECT_GT(hand.tool_ticks(), 0) << "nothing was at stake";
  }
}

}  // namespace test_adversary
}  // namespace palpate
