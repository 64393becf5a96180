// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/session/summary.hpp"

#include "tests/session/fakes.hpp"

namespace palpate {
namespace test_summary {

constexpr double r_c = 0.005;  // [m]

ServoTick servo_tick(double t, double asked, double sent, std::uint32_t safety = 0) {
  ServoTick record;
  record.tick.t = t;
  record.tick.force = Vec3(0.0, 0.0, -asked);
  record.tick.state = asked > 0.0 ? ContactState::contact : ContactState::free_motion;
  record.tick.steps = 2;
  record.force = Vec3(0.0, 0.0, -sent);
  record.safety = safety;
  return record;
}

TEST(Summary, TellsWhatWasAskedForFromWhatWasSent) {
  Summary summary;
  summary.count(servo_tick(1.0, 0.0, 0.0), std::nullopt, r_c);
  summary.count(servo_tick(1.1, 17.9, 3.3, force_cut), std::nullopt, r_c);
  summary.count(servo_tick(1.2, 5.0, 0.0, force_cut | frame_lost), std::nullopt, r_c);
  EXPECT_EQ(summary.ticks, 3U);
  EXPECT_EQ(summary.contact_ticks, 2U);
  EXPECT_EQ(summary.steps, 6U);
  EXPECT_EQ(summary.largest_asked, 17.9);
  EXPECT_EQ(summary.largest_sent, 3.3);
  EXPECT_EQ(summary.force_ticks, 1U);
  EXPECT_NEAR(summary.duration(), 0.2, 1e-12);
  std::size_t raised = 0;
  for (std::size_t bit = 0; bit < safety_flag_count; ++bit) raised += summary.safety_ticks[bit];
  EXPECT_EQ(raised, 3U);
  EXPECT_EQ(summary.safety_ticks[2], 2U) << "force_cut is bit 2";
  EXPECT_EQ(summary.safety_ticks[10], 1U) << "frame_lost is bit 10";
}

TEST(Summary, CountsATickWithoutADeviceAsSent) {
  Summary summary;
  summary.count(servo_tick(0.0, 4.0, 1.0).tick, std::nullopt, r_c);
  EXPECT_EQ(summary.largest_sent, 4.0);
}

TEST(Summary, SuspectsAPopThroughThatLastsLongerThanAFrame) {
  const auto pops = [](std::int64_t frames_behind) {
    Summary summary;
    const auto tick = [&](std::int64_t frame, double behind) {
      ServoTick record = servo_tick(0.01 * static_cast<double>(frame), 1.0, 1.0);
      record.tick.frame = frame;
      summary.count(record, behind, r_c);
    };
    tick(0, -0.004);
    for (std::int64_t k = 1; k <= frames_behind; ++k) tick(k, 0.02);
    tick(frames_behind + 1, -0.004);
    return summary.pop_throughs;
  };
  EXPECT_EQ(pops(1), 0U);
  EXPECT_EQ(pops(2), 0U);
  EXPECT_EQ(pops(3), 1U);
  EXPECT_EQ(pops(30), 1U) << "one that lasts is one";
}

TEST(Summary, TakesTheCameraThatSeesTheProxyLeastBehind) {
  // The same place is 10 mm behind what one camera measured and 20 mm before what another did.
  const std::vector<std::shared_ptr<const Cloud>> cameras = {test::wall(490), nullptr,
                                                             test::wall(520)};
  const auto behind = least_behind(cameras, Vec3(0.0, 0.0, 0.5), r_c);
  ASSERT_TRUE(behind);
  EXPECT_NEAR(*behind, -0.02, 1e-6);
  EXPECT_FALSE(least_behind({}, Vec3(0.0, 0.0, 0.5), r_c));
}

}  // namespace test_summary
}  // namespace palpate
