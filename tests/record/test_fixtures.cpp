// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "palpate/record/replay.hpp"

#include "tests/record/loop_session.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_fixtures {

// About where LoopSession's hand goes.
std::shared_ptr<const FixtureSet> fixtures_about_the_hand() {
  const auto at = [](double x, double y, double z) {
    return Eigen::Isometry3d(Eigen::Translation3d(x, y, z));
  };
  return std::make_shared<const FixtureSet>(
      std::vector<Fixture>{{.name = "floor",
                            .shape = FixtureShape::half_space,
                            .world_from_fixture = at(0.0, 0.0, -1.0 / 30.0)},
                           {.name = "seen",
                            .shape = FixtureShape::seen,
                            .world_from_fixture = at(0.03, -0.05, -0.03),
                            .size = Vec3::Constant(0.3),
                            .numbers = {.margin = 0.008}},
                           {.name = "here",
                            .kind = FixtureKind::guide,
                            .shape = FixtureShape::point,
                            .world_from_fixture = at(0.03, -0.05, -0.025),
                            .consent = true},
                           {.name = "calm",
                            .kind = FixtureKind::viscous,
                            .shape = FixtureShape::sphere,
                            .world_from_fixture = at(0.03, -0.05, -0.03),
                            .radius = 0.1}});
}

// From its beginning, and from the midst of it.
TEST(RecordedFixtures, AreReplayedBitForBit) {
  for (const int before : {0, 210}) {
    SCOPED_TRACE(before);
    const test::TemporaryFolder folder;
    test::LoopSession session("sight", fixtures_about_the_hand());
    SessionReader reader = session.recorded(folder, before, 400);
    std::uint32_t acting = 0;
    for (std::size_t i = 0; i < reader.ticks(); ++i) acting |= reader.tick(i).fixtures;
    EXPECT_EQ(acting & 0b1101U, 0b1101U);  // what is replayed did something
    const ServoSettings& settings = reader.commands(reader.tick(0).settings_number).settings;
    ASSERT_TRUE(settings.fixtures);
    EXPECT_EQ(settings.fixtures->items().size(), 4U);
  }
}

}  // namespace test_fixtures
}  // namespace palpate
