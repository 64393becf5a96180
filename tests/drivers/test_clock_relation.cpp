// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "palpate/drivers/link_estimates.hpp"

namespace palpate {
namespace test_clock_relation {

constexpr double ahead = 1234.5;  // [s]

// Questions twice a second over a link whose ways there and back take 1 to 40 ms, each by chance.
class ClockRelationOverALink : public ::testing::Test {
 protected:
  void ask(int times, double drift = 0.0) {
    for (int i = 0; i < times; ++i, now_ += 0.5) {
      const double there = way();
      const double answered = now_ + there;
      const double heard = answered + way();
      relation_.add(now_, answered + ahead_ + drift * answered, heard);
      error_ = relation_.difference() - (ahead_ + drift * heard);
      EXPECT_LE(std::abs(error_), relation_.uncertainty(heard) + 1e-9) << "at " << now_;
    }
  }
  double way() { return 0.001 + ways_(random_); }

  std::mt19937 random_{1};
  std::exponential_distribution<double> ways_{1.0 / 0.01};  // [1/s]
  ClockRelation relation_;
  double ahead_ = ahead;  // [s]
  double now_ = 100.0;    // [s]
  double error_ = 0.0;    // [s]
};

TEST_F(ClockRelationOverALink, IsAsUncertainAsTheBestRoundTrip) {
  EXPECT_FALSE(relation_.is_known());
  ask(40);
  EXPECT_TRUE(relation_.is_known());
  EXPECT_LT(relation_.uncertainty(now_), 0.006);
}

TEST_F(ClockRelationOverALink, FollowsAClockThatDrifts) {
  ask(1200, 50e-6);  // 30 ms in these 10 minutes
  EXPECT_LT(std::abs(error_), 0.004);
}

TEST_F(ClockRelationOverALink, BelievesThatAClockWasSetWhenThreeAnswersSaySo) {
  ask(20);
  ahead_ += 7.0;
  const double before = relation_.difference();
  relation_.add(now_, now_ + 0.001 + ahead_, now_ + 0.002);
  relation_.add(now_, now_ + 0.001 + ahead_, now_ + 0.002);
  EXPECT_NEAR(relation_.difference(), before, 0.01);
  relation_.add(now_, now_ + 0.001 + ahead_, now_ + 0.002);
  EXPECT_NEAR(relation_.difference(), ahead_, 0.001);
}

// A better answer moves what is given slowly: intervals between stamps stay.
TEST(ClockRelation, ChangesSlowly) {
  ClockRelation relation;
  relation.add(10.0, 10.0 + ahead, 10.1);  // the answer's way took all of it
  EXPECT_NEAR(relation.difference(), ahead - 0.05, 1e-9);
  relation.add(10.5, 10.5 + ahead, 10.5);
  EXPECT_NEAR(relation.difference(), ahead - 0.05 + 0.4e-3, 1e-9);
  EXPECT_NEAR(relation.uncertainty(10.5), 0.05 - 0.4e-3, 1e-9);
  for (double t = 11.0; t < 80.0; t += 0.5) relation.add(t, t + ahead, t);
  EXPECT_NEAR(relation.difference(), ahead, 1e-9);
}

TEST(ClockRelation, PassesOverWhatCannotBe) {
  ClockRelation relation;
  relation.add(10.0, std::nan(""), 10.1);
  relation.add(10.0, 20.0, 9.9);
  EXPECT_FALSE(relation.is_known());
  EXPECT_EQ(relation.uncertainty(10.0), 0.0);
}

}  // namespace test_clock_relation
}  // namespace palpate
