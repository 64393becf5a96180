// SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "tests/servo/adversary.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace test_adversary {

constexpr std::uint64_t ticks = test::sanitized ? 50'000 : 1'000'000;

// The same for longer: `ninja adversarial_ticks`.
// Hazard: too-much-force
TEST(Adversary, GetsNoForceThatBreaksAPromise) {
  test::Adversary adversary(1);
  while (adversary.ticks() < ticks) {
    const std::string broken = adversary.step();
    ASSERT_TRUE(broken.empty()) << broken;
  }
  EXPECT_GT(adversary.strongest(), 3.0) << "nothing was at stake";
  EXPECT_GT(adversary.forceful_ticks(), ticks / 50) << "nothing was at stake";
}

}  // namespace test_adversary
}  // namespace palpate
