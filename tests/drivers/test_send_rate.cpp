// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "palpate/drivers/link_estimates.hpp"

namespace palpate {
namespace test_send_rate {

// A camera of 30 Hz before a link of a queue, whose far end reports ten times a second.
struct Link {
  double rate = 100.0;  // [Hz] images a second that it carries
  double lost = 0.0;    // share by chance
  SendRate sender{};
  double queue = 0.0;  // [s] what waits in it
  double now = 100.0;  // [s]
  double sent = 0.0;   // [Hz]
  double least = 1.0;  // [s] that an image took

  void run(double seconds) {
    constexpr double most_queue = 0.25;
    std::mt19937 random(1);
    double came = 0.0;
    double counted = 0.0;
    double lateness = 0.0;
    sent = 0.0;
    for (int frame = 0; frame < static_cast<int>(30.0 * seconds); ++frame, now += 1.0 / 30.0) {
      queue = std::max(queue - 1.0 / 30.0, 0.0);
      if (sender.allows(now)) {
        sent += 1.0 / seconds;
        counted += 1.0;
        const double fits = std::clamp((most_queue - queue) * rate, 0.0, 1.0);
        const double noise = std::uniform_real_distribution<double>(0.5, 1.5)(random);
        came += fits * (1.0 - lost * noise);
        queue += fits / rate;
        least = std::min(least, queue);
        lateness = std::max(lateness, queue - least);
      }
      if (frame % 3 == 0 && counted > 0.0) {
        sender.report(now, came / counted, lateness, came / counted * sender.copies());
        came = counted = lateness = 0.0;
      }
    }
  }
};

TEST(SendRate, SendsEveryImageWhereTheLinkCarriesThem) {
  Link link;
  link.run(20.0);
  EXPECT_NEAR(link.sent, 30.0, 0.1);
}

TEST(SendRate, SendsEveryImageWhereSomeIsLostByChance) {
  Link link{.lost = 0.05};
  link.run(20.0);
  EXPECT_NEAR(link.sent, 30.0, 0.1);
}

TEST(SendRate, SendsNoMoreThanTheLinkCarriesAndMostOfThat) {
  for (const double rate : {16.0, 8.0, 4.0}) {
    Link link{.rate = rate};
    link.run(10.0);
    link.run(60.0);
    EXPECT_LE(link.sent, 1.3 * rate);  // what is too much is lost in part
    EXPECT_GE(link.sent, 0.6 * rate);
  }
}

TEST(SendRate, ComesBackWhenTheLinkDoes) {
  Link link{.rate = 4.0};
  link.run(20.0);
  link.rate = 100.0;
  link.run(20.0);
  link.run(5.0);
  EXPECT_NEAR(link.sent, 30.0, 0.3);
}

TEST(SendRate, SendsTwiceWhereSomeIsLostByChanceAndThereIsRoom) {
  Link lossy{.lost = 0.05};
  lossy.run(10.0);
  EXPECT_EQ(lossy.sender.copies(), 2);
  lossy.lost = 0.0;
  lossy.run(10.0);
  EXPECT_EQ(lossy.sender.copies(), 1);
  Link narrow{.rate = 16.0, .lost = 0.05};
  narrow.run(60.0);
  EXPECT_EQ(narrow.sender.copies(), 1);
  EXPECT_GE(narrow.sent, 0.5 * narrow.rate);
}

// Where copies are too much for a link they end at once, and no image is missing for it.
TEST(SendRate, EndsCopiesFirst) {
  SendRate sender;
  double now = 100.0;
  const auto report = [&](int times, double lateness, double heard) {
    for (int i = 0; i < times; ++i, now += 0.1) {
      for (int frame = 0; frame < 3; ++frame) sender.allows(now + frame / 30.0);
      sender.report(now, 0.97, lateness, heard);
    }
  };
  report(30, 0.0, 0.95);
  EXPECT_EQ(sender.copies(), 2);
  report(1, 0.2, 1.5);
  EXPECT_EQ(sender.copies(), 1);
  EXPECT_GT(sender.limit(), 100.0);
  report(100, 0.0, 0.95);
  EXPECT_EQ(sender.copies(), 1) << "not again soon";
  report(300, 0.0, 0.95);
  EXPECT_EQ(sender.copies(), 2);
}

TEST(SendRate, NeverStops) {
  SendRate sender;
  for (int i = 0; i < 1000; ++i) sender.report(100.0 + 0.1 * i, 0.0, 10.0, 0.0);
  sender.report(200.0, std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0);
  EXPECT_EQ(sender.limit(), 2.0);
  int sent = 0;
  for (int frame = 0; frame < 300; ++frame) sent += sender.allows(201.0 + frame / 30.0) ? 1 : 0;
  EXPECT_NEAR(sent, 20, 1);
}

}  // namespace test_send_rate
}  // namespace palpate
