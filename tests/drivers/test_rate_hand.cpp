// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <memory>
#include <thread>

#include <gtest/gtest.h>

#include "palpate/drivers/rate_hand.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_rate_hand {

// What the test and the sticks' thread share.
struct Bench {
  std::atomic<double> x{0.0}, y{0.0}, z{0.0};
  std::atomic<bool> plugged_in{true};
  std::atomic<int> waits{0}, begins{0};
  std::atomic<double> share{0.0};
};

class BenchSticks final : public Sticks {
 public:
  explicit BenchSticks(Bench& bench) : bench_(bench) {}
  StickState wait() noexcept override {
    std::this_thread::yield();
    ++bench_.waits;
    return {.deflection = Vec3(bench_.x, bench_.y, bench_.z),
            .buttons = 5U,
            .plugged_in = bench_.plugged_in};
  }
  void feel(double share, bool begins) noexcept override {
    bench_.share = share;
    if (begins) ++bench_.begins;
  }

 private:
  Bench& bench_;
};

class RateHands : public ::testing::Test {
 protected:
  void settle() const {
    for (const int before = bench.waits; bench.waits < before + 3;) std::this_thread::yield();
  }
  Bench bench;
  RateHand hand{std::make_unique<BenchSticks>(bench),
                {.uri = "test:", .kind = "test", .limits = no_motors},
                {.start = Vec3(0.0, 0.0, 0.1), .speed = 0.2, .dead_zone = 0.1}};
};

TEST_F(RateHands, MoveAtASpeedThatGrowsWithTheSquareBeyondTheDeadZone) {
  EXPECT_EQ(hand.read(1.0).position, Vec3(0.0, 0.0, 0.1));
  bench.x = 1.0;
  bench.y = -0.55;  // half way from the dead zone to the end
  bench.z = 0.09;   // within the dead zone
  settle();
  const HandState state = hand.read(1.01);
  EXPECT_NEAR(state.position.x(), 0.01 * 0.2, 1e-12);
  EXPECT_NEAR(state.position.y(), 0.01 * -0.05, 1e-12);
  EXPECT_EQ(state.position.z(), 0.1);
  EXPECT_EQ(state.buttons, 5U);
  EXPECT_NEAR(hand.read(9.0).position.x(), 0.012, 1e-12) << "50 ms at most, after a stall";
}

TEST_F(RateHands, StayAndGiveNoForceWhileUnplugged) {
  bench.x = 1.0;
  bench.plugged_in = false;
  settle();
  hand.read(1.0);
  const HandState state = hand.read(1.01);
  EXPECT_FALSE(state.present);
  EXPECT_EQ(state.fault, DeviceFault::disconnected);
  EXPECT_EQ(state.position.x(), 0.0);
}

TEST_F(RateHands, LetAContactBeFeltAsItBeginsAndAsItLasts) {
  hand.write(Vec3(0.0, 0.0, 1.65), 1.0);
  settle();
  EXPECT_EQ(bench.share, 0.5) << "of the 3.3 N of a hand without motors";
  EXPECT_EQ(bench.begins, 1);
  hand.write(Vec3::Zero(), 1.0);
  settle();
  EXPECT_EQ(bench.share, 0.0);
  EXPECT_EQ(bench.begins, 1);
}

TEST(RateOptions, AreRead) {
  const RateOptions options = rate_options(Uri("gamepad:?x=1cm&z=0&speed=0.3&dead_zone=20%"));
  EXPECT_DOUBLE_EQ(options.start.x(), 0.01);
  EXPECT_DOUBLE_EQ(options.speed, 0.3);
  EXPECT_DOUBLE_EQ(options.dead_zone, 0.2);
  EXPECT_TRUE(test::fails_saying([] { return rate_options(Uri("gamepad:?speed=9")); }, "speed"));
}

}  // namespace test_rate_hand
}  // namespace palpate
