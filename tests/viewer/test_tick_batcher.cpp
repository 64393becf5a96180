// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "palpate/net/viewer/protocol.hpp"

namespace palpate {
namespace test_tick_batcher {

constexpr double r_c = 0.005;  // [m]

ServoTick tick_at(double t) {
  ServoTick record{};
  record.tick.t = t;
  record.tick.hip = record.tick.proxy = record.tick.normal = Vec3::Zero();
  record.tick.state = ContactState::free_motion;
  record.force = Vec3::Zero();
  return record;
}

TEST(TickBatcher, HasNothingBeforeATick) {
  TickBatcher batcher(5);
  EXPECT_FALSE(batcher.take());
  batcher.add(tick_at(1.0), r_c);
  EXPECT_TRUE(batcher.take());
  EXPECT_FALSE(batcher.take());
}

TEST(TickBatcher, ShowsTheNewestTickAndForgetsNoFlag) {
  TickBatcher batcher(5);
  ServoTick first = tick_at(1.0);
  first.tick.flags = step_budget_hit;
  first.safety = force_cut;
  batcher.add(first, r_c);
  ServoTick second = tick_at(1.001);
  second.tick.flags = frame_stale;
  batcher.add(second, r_c);
  const auto batch = batcher.take();
  ASSERT_TRUE(batch);
  EXPECT_EQ(batch->newest.tick.t, 1.001);
  EXPECT_EQ(batch->flags, step_budget_hit | frame_stale);
  EXPECT_EQ(batch->safety, std::uint32_t{force_cut});
  batcher.add(tick_at(1.002), r_c);
  EXPECT_EQ(batcher.take()->flags, 0u) << "flags of the batch before";
}

TEST(TickBatcher, KeepsTheExtremesOfEachSample) {
  TickBatcher batcher(3);
  for (int i = 0; i < 7; ++i) {
    ServoTick record = tick_at(0.001 * i);
    record.force = Vec3(0.0, 0.0, i == 1 ? 3.0 : 1.0);
    record.tick.steps = i == 2 ? 9 : 1;
    record.energy.relative.excess = 1e-4 * i;
    record.energy.absolute.excess = -1e-3 * i;
    record.previous_compute_ns = i == 0 ? 4000 : 1000;
    record.tick.state = i == 4 ? ContactState::contact : ContactState::free_motion;
    record.tick.proxy = Vec3(0.0, 0.0, r_c);
    record.tick.normal = Vec3::UnitZ();
    record.tick.hip = Vec3(0.0, 0.0, -0.004);
    batcher.add(record, r_c);
  }
  const auto batch = batcher.take();
  ASSERT_TRUE(batch);
  ASSERT_EQ(batch->samples.size(), 2u) << "the seventh tick waits for two more";
  EXPECT_EQ(batch->samples[0].t, 0.002);
  EXPECT_EQ(batch->samples[0].force, 3.0F);
  EXPECT_EQ(batch->samples[0].steps, 9.0F);
  EXPECT_FLOAT_EQ(batch->samples[0].tick_time, 4e-6F);
  EXPECT_FLOAT_EQ(batch->samples[0].relative, 2e-4F) << "of its last tick";
  EXPECT_FLOAT_EQ(batch->samples[1].absolute, -5e-3F);
  EXPECT_EQ(batch->samples[0].penetration, 0.0F) << "free: the hand is not in anything";
  EXPECT_FLOAT_EQ(batch->samples[1].penetration, 0.004F);
  batcher.add(tick_at(0.007), r_c);
  batcher.add(tick_at(0.008), r_c);
  EXPECT_EQ(batcher.take()->samples.size(), 1u);
}

TEST(TickBatcher, MeasuresPenetrationFromTheSurfaceNotFromTheProxy) {
  const auto penetration = [](const Vec3& hip, const Vec3& normal) {
    TickBatcher batcher(1);
    ServoTick record = tick_at(1.0);
    record.tick.state = ContactState::contact;
    record.tick.proxy = Vec3(0.0, 0.0, r_c);  // on the surface z = 0
    record.tick.normal = normal;
    record.tick.hip = hip;
    batcher.add(record, r_c);
    return batcher.take()->samples.at(0).penetration;
  };
  EXPECT_EQ(penetration({0.0, 0.0, 0.0048}, Vec3::UnitZ()), 0.0F)
      << "the sphere touches, the HIP is above";
  EXPECT_FLOAT_EQ(penetration({0.0, 0.0, -0.0025}, Vec3::UnitZ()), 0.0025F);
  EXPECT_FLOAT_EQ(penetration({0.03, 0.0, -0.0025}, Vec3::UnitZ()), 0.0025F) << "dragged aside";
  EXPECT_FLOAT_EQ(penetration({0.0, 0.0, -0.0025}, Vec3::Zero()), 0.0025F) << "no normal is known";
}

}  // namespace test_tick_batcher
}  // namespace palpate
