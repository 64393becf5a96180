// SPDX-License-Identifier: Apache-2.0
// The experiments `teleop` and `teleop-faults`, at reduced size: what docs/teleop.md claims.
#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "lab/experiment.hpp"
#include "lab/experiments/teleop.hpp"

#include "tests/support/errors.hpp"

namespace palpate::lab {
namespace test_teleop {

TeleopCase over(std::string_view way, double round_trip, bool poor = false) {
  LinkQuality link{.delay = 0.5 * round_trip};
  if (poor) {
    link.jitter = std::min(0.03, link.delay);
    link.loss = 0.05;
  }
  return {.way = way, .up = link, .down = link};
}

// Hazard: link-delay
TEST(Teleop, FeelsTheSameAtEveryDelay) {
  const TeleopFigures here = play_teleop_case(teleop_scene("rest", "ideal", 1), over("palpate", 0));
  ASSERT_GT(here.force, 1.0);
  for (const double round_trip : {0.1, 0.5}) {
    const TeleopFigures far =
        play_teleop_case(teleop_scene("rest", "ideal", 1), over("palpate", round_trip, true));
    EXPECT_NEAR(far.force, here.force, 0.05 * here.force);
    EXPECT_LE(far.shake, here.shake + 0.05e-3);
    EXPECT_LE(far.energy, here.energy + 0.1e-3);
    EXPECT_LE(far.depth, 0.5e-3);
    EXPECT_LE(far.contact, 5.0);
  }
}

// Hazard: robot-struck
TEST(Teleop, KeepsTheToolOutOfWhatComes) {
  for (const std::string_view sensor : {"ideal", "d4xx"}) {
    const TeleopFigures figures =
        play_teleop_case(teleop_scene("come", sensor, 1), over("palpate", 0.2));
    EXPECT_LE(figures.depth, 1e-3) << sensor;
    EXPECT_GT(figures.most_force, 0.5) << "nothing came";
  }
}

TEST(Teleop, ForcesThatCrossTheLinkSwing) {
  for (const std::string_view way : {"position-force", "tdpa"}) {
    const TeleopFigures figures =
        play_teleop_case(teleop_scene("rest", "ideal", 1), over(way, 0.1));
    EXPECT_GT(figures.swing, 1e-3) << way;
  }
}

// Hazard: robot-runaway
// The hand presses on a resting plane while the link is down for 1.5 s and comes back.
TEST(Teleop, StopsWithTheLinkAndComesBackWithoutAKick) {
  TeleopScene scene = teleop_scene("rest", "ideal", 1);
  scene.hand = HipPath({{0.0, {0.0, 0.0, 0.03}},
                        {2.5, {0.0, 0.0, 0.03}},
                        {3.0, {0.0, 0.0, -0.01}},
                        {3.5, {0.0, 0.0, -0.01}},
                        {5.5, {0.08, 0.0, -0.01}},
                        {20.0, {0.08, 0.0, -0.01}}});
  scene.duration = 9.0;
  TeleopCase one = over("palpate", 0.1);
  one.up.down_from = one.down.down_from = 4.0;
  one.up.down_until = one.down.down_until = 6.5;
  double before = 0.0;
  double stopped = 0.0;
  double without = 9.0;
  double kick = 0.0;
  double after = 0.0;
  play_teleop(scene, one, [&](const TeleopTick& tick) {
    if (tick.t < 4.05) before = tick.force.norm();
    // The last lead arrives at 4.05.
    if (stopped == 0.0 && tick.t > 4.05 && tick.tool_velocity.norm() < 0.01) stopped = tick.t;
    if (tick.t > 4.1 && tick.force.norm() == 0.0) without = std::min(without, tick.t);
    if (tick.t > 6.5) kick = std::max(kick, tick.hand_speed);
    after = tick.force.norm();
  });
  EXPECT_GT(before, 0.5);
  EXPECT_LE(stopped, 4.05 + 0.1);
  EXPECT_GT(without, 4.2);  // it keeps what it knows
  EXPECT_LT(without, 5.0);
  EXPECT_LE(kick, 0.04);
  EXPECT_NEAR(after, before, 0.3 * before);
}

TEST(TeleopFaults, EpisodesBreakNothingWhileThingsRest) {
  int played = 0;
  for (std::uint64_t number = 1; played < 4; ++number) {
    for (const std::string_view fault : {"link", "operator"}) {
      const TeleopEpisode episode = teleop_episode(fault, number);
      if (episode.moves) continue;
      const EpisodeFigures figures = play_episode(episode);
      EXPECT_LE(figures.breach, 1e-3) << fault << ' ' << number;
      EXPECT_LE(figures.contact, 5.0) << fault << ' ' << number;
      EXPECT_LE(figures.stop.value_or(0.0), 0.12) << fault << ' ' << number;
      ++played;
    }
  }
  const Experiment& experiment = find_experiment("teleop-faults");
  ExperimentOptions options;
  options.families = {"linc"};
  EXPECT_TRUE(test::fails_saying([&] { experiment.cells(experiment, options); }, "linc", "no such",
                                 "link"));
}

// A ball beside a wall that is forbidden, before an exact camera: what keeps the tool out of the
// wall must not push it into the ball.
TEST(TeleopFaults, AWallDoesNotPushTheToolIntoASurface) {
  const TeleopEpisode episode = teleop_episode("none", 3000022);
  ASSERT_FALSE(episode.moves);
  const EpisodeFigures figures = play_episode(episode);
  EXPECT_LE(figures.contact, 0.5);
  EXPECT_LE(figures.breach, 0.1e-3);
}

// In this episode the robot's own proxy is lost: the hand is led through a ball, and the proxy
// comes out behind it. The tool followed at 0.27 m/s and hit the ball with 43 N.
TEST(TeleopFaults, AToolDoesNotFollowAProxyThroughWhatIsSeen) {
  const TeleopEpisode episode = teleop_episode("none", 32000524);
  ASSERT_FALSE(episode.moves);
  const EpisodeFigures figures = play_episode(episode);
  EXPECT_LT(figures.contact, 5.0);
  EXPECT_LT(figures.breach, 5e-4);
}

// A ball before a noisy camera: the proxy slips under its surface, whose normal is then that of its
// back, and pushes the tool through it: 24 N.
TEST(TeleopFaults, AToolIsNotPushedThroughASurfaceByItsBack) {
  const TeleopEpisode episode = teleop_episode("none", 33000248);
  ASSERT_FALSE(episode.moves);
  EXPECT_LT(play_episode(episode).contact, 5.0);
}

TEST(Teleop, MakesItsTable) {
  ExperimentOptions options;
  options.families = {"rest"};
  const Experiment& teleop = find_experiment("teleop");
  const std::vector<Cell> cells = teleop.cells(teleop, options);
  ASSERT_EQ(cells.size(), 5U);  // palpate with two sensors, three others
  const std::string rows = cells.back()();
  const Table table("teleop", std::string(teleop.header) + "\n" + rows);
  EXPECT_EQ(table.rows(), 11U);
  const Scores scores = teleop.scores(table);
  ASSERT_EQ(scores.rows.size(), 1U);
  EXPECT_EQ(scores.rows[0].size(), scores.columns.size());
  EXPECT_EQ(scores.rows[0][0], "tdpa");
  options.families = {"rust"};
  EXPECT_TRUE(
      test::fails_saying([&] { teleop.cells(teleop, options); }, "rust", "no such", "rest"));
}

TEST(Teleop, OneOfItsCouplingsCanBePlayedAlone) {
  ExperimentOptions options;
  options.methods = {"wave"};  // no method of the lab
  EXPECT_EQ(methods_of(find_experiment("teleop"), options), options.methods);
  EXPECT_TRUE(test::fails_saying([&] { methods_of(find_experiment("lift"), options); }, "wave"));
}

}  // namespace test_teleop
}  // namespace palpate::lab
