// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/net/teleop/behind_arm.hpp"

namespace palpate {
namespace test_behind_arm {

constexpr int width = 80, height = 64;
constexpr double units = 1e4;  // readings a metre
constexpr float nothing = std::numeric_limits<float>::infinity();

// A slope 0.7 m away, and an arm 0.5 m away before columns 30 to 49.
class BehindArmTest : public ::testing::Test {
 protected:
  static int slope(int u, int v) { return 7000 + 3 * u - 2 * v; }
  static bool is_hidden(std::size_t i) { return i % width >= 30 && i % width < 50; }

  std::vector<std::uint16_t> fill(bool arm, const std::function<int(int, int)>& scene,
                                  float arm_depth = 0.5F) {
    std::vector<std::uint16_t> readings;
    std::vector<float> arms;
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        const bool hides = arm && is_hidden(readings.size());
        readings.push_back(hides ? std::uint16_t{0} : static_cast<std::uint16_t>(scene(u, v)));
        arms.push_back(hides ? arm_depth : nothing);
      }
    }
    memory_.fill(readings, arms, units, t_ += 0.1);
    return readings;
  }
  // How many of the hidden pixels show something.
  static int shown(const std::vector<std::uint16_t>& readings) {
    int count = 0;
    for (std::size_t i = 0; i < readings.size(); ++i) count += is_hidden(i) && readings[i] != 0;
    return count;
  }
  static constexpr int hidden = 20 * height;

  BehindArm memory_{width, height, {.kept = 5.0}};
  double t_ = 0.0;
};

TEST_F(BehindArmTest, ShowsWhatWasSeenThere) {
  const auto before = fill(false, slope);
  for (int i = 0; i < 30; ++i) EXPECT_EQ(fill(true, slope), before);
}

TEST_F(BehindArmTest, IsAHoleWhereNothingWasSeen) { EXPECT_EQ(shown(fill(true, slope)), 0); }

TEST_F(BehindArmTest, ForgetsInTime) {
  fill(false, slope);
  EXPECT_EQ(shown(fill(true, slope)), hidden);
  t_ += 5.0;
  EXPECT_EQ(shown(fill(true, slope)), 0);
}

TEST_F(BehindArmTest, ForgetsWhereTheArmIsFarther) {
  fill(false, slope);
  EXPECT_EQ(shown(fill(true, slope, 0.69F)), hidden);
  EXPECT_EQ(shown(fill(true, slope, 0.75F)), 0);
}

TEST_F(BehindArmTest, ForgetsWhatMoves) {
  // The lower half comes nearer by 0.4 mm a frame.
  fill(false, slope);
  std::vector<std::uint16_t> readings;
  for (int i = 1; i <= 10; ++i)
    readings = fill(true, [i](int u, int v) { return slope(u, v) - (v >= 32 ? 4 * i : 0); });
  for (const int v : {8, 56}) {
    const std::size_t i = static_cast<std::size_t>(v) * width + 40;
    EXPECT_EQ(readings[i] != 0, v == 8) << v;
  }
}

TEST_F(BehindArmTest, TakesNoiseForNoMotion) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 20.0);  // 2 mm
  const auto noisy = [&](int u, int v) { return slope(u, v) + static_cast<int>(noise(random)); };
  fill(false, noisy);
  for (int i = 0; i < 30; ++i) EXPECT_EQ(shown(fill(true, noisy)), hidden);
}

TEST_F(BehindArmTest, BeginsAnewWhereTimeDoes) {
  fill(false, slope);
  t_ = -1.0;
  EXPECT_EQ(shown(fill(true, slope)), 0);
}

TEST_F(BehindArmTest, RefusesImagesOfAnotherSize) {
  std::vector<std::uint16_t> readings(10);
  const std::vector<float> arm(10);
  EXPECT_THROW(memory_.fill(readings, arm, units, 0.0), Error);
  EXPECT_THROW(BehindArm(0, 4), Error);
}

}  // namespace test_behind_arm
}  // namespace palpate
