// SPDX-License-Identifier: Apache-2.0
// The experiments of tools: the shape is where the truth is, and a penalty is not.
#include <algorithm>
#include <cstdint>

#include <gtest/gtest.h>

#include "lab/experiment.hpp"
#include "lab/experiments/tool_cases.hpp"
#include "lab/runner.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_tool {

Table run_of(const std::string& name, const std::string& experiment = "tool", int cases = 1) {
  ExperimentOptions options;
  options.families = {name};
  options.cases = cases;
  RunnerOptions runner;
  runner.jobs = 2;
  const test::TemporaryFolder folder;
  return {experiment,
          run_experiment(find_experiment(experiment), options, runner, folder.path() / "run.csv")};
}

double value(const Table& table, const std::string& camera, const std::string& method,
             std::string_view column) {
  return table
      .numbers(column,
               [&](std::size_t row) {
                 return table.text(row, "camera") == camera && table.text(row, "method") == method;
               })
      .at(0);
}

TEST(ToolExperiment, ABoxThatLiesFlatHasTheTrueForceAndAPenaltyHasNot) {
  const Table table = run_of("flat");
  ASSERT_EQ(table.rows(), 6U);
  for (const char* camera : {"ideal", "d4xx"}) {
    EXPECT_NEAR(value(table, camera, "shape", "force"), 3.0, 1e-3) << "600 N/m by 5 mm";
    EXPECT_LT(value(table, camera, "shape", "force_error"), 0.05) << camera;
    EXPECT_GT(value(table, camera, "penalty", "force_error"), 0.2) << camera;
    EXPECT_GT(value(table, camera, "voxels", "force_error"), 0.05) << camera;
    EXPECT_EQ(value(table, camera, "shape", "behind"), 0.0) << camera;
  }
  EXPECT_LT(value(table, "ideal", "shape", "torque_error"), 0.05);
  const Experiment& tool = find_experiment("tool");
  const Scores scores = tool.scores(table);
  ASSERT_EQ(scores.rows.size(), 6U);
  EXPECT_EQ(scores.rows[0].size(), scores.columns.size());
}

TEST(ToolCases, BeginAndStayOutsideOfWhatTheyTouchAndArePressed) {
  for (const std::string_view family : tool_families) {
    int pressed = 0, free = 0;
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const ToolCase one = draw_tool_case(family, seed);
      const Scene bodies(one.bodies);
      const HipPath hand(one.hand);
      EXPECT_GT(clearance(bodies, *one.tool, hand.pose_at(0.0), 0.0), 5e-3) << family << seed;
      EXPECT_EQ(hand.pose_at(0.2).position, hand.pose_at(0.0).position) << "frames come first";
      double deepest = 0.0;
      for (double t = 0.0; t < one.ends; t += 10e-3) {
        const double gap = clearance(bodies, *one.tool, hand.pose_at(t), t);
        deepest = std::min(deepest, gap);
        free += gap > 3.0 * one.sigma ? 1 : 0;
      }
      pressed += deepest < -1.9e-3 ? 1 : 0;
    }
    EXPECT_EQ(pressed, 5) << family;
    EXPECT_GT(free, 20) << family;
  }
}

TEST(ToolCases, AToolStaysBeforeASurfaceThatComesAndAPenaltyDoesNot) {
  const Table table = run_of("coming", "tool-cases", 2);
  ASSERT_EQ(table.rows(), 3U);
  EXPECT_LT(table.number(0, "longest"), 0.1);
  EXPECT_EQ(table.number(0, "behind"), 0.0);
  for (const std::size_t peer : {1U, 2U}) {
    EXPECT_GT(table.number(peer, "longest"), 0.3) << table.text(peer, "method");
    EXPECT_EQ(table.number(peer, "behind"), 2.0);
    EXPECT_EQ(table.text(peer, "seeds"), "1 2");
  }
  const Scores scores = find_experiment("tool-cases").scores(table);
  ASSERT_EQ(scores.rows.size(), 3U);
  EXPECT_EQ(scores.rows[0].size(), scores.columns.size());
}

TEST(ToolCases, AToolIsNotInABoxThatSlidesIn) {
  const Table table = run_of("sliding", "tool-cases", 3);
  EXPECT_EQ(table.number(0, "behind"), 0.0);
  EXPECT_LT(table.number(0, "longest"), 0.1);
  EXPECT_EQ(table.number(1, "behind"), 3.0);
}

TEST(ToolCases, LiftedToolsAreNotPulled) {
  const Table table = run_of("lifting", "tool-cases", 1);
  EXPECT_EQ(table.number(0, "lifts"), 8.0);
  EXPECT_EQ(table.number(0, "pulled"), 0.0);
  EXPECT_EQ(table.number(0, "behind"), 0.0);
}

TEST(ToolExperiment, ALongToolBetweenLightFingersRestsBelowAStiffnessInRotation) {
  const Table table = run_of("light", "turning");
  ASSERT_EQ(table.rows(), 2U);
  EXPECT_EQ(table.text(1, "tool"), "capsule:200x10mm");
  EXPECT_LT(table.number(1, "free_force"), 0.8) << "the chain takes force off what swings";
  EXPECT_LT(table.number(1, "rate"), 0.02);
  EXPECT_GT(table.number(1, "force"), 0.8);
  EXPECT_GT(table.number(1, "stiffest"), 1.0) << "what a session sets";
  EXPECT_LT(table.number(1, "stiffest"), 100.0);
  EXPECT_EQ(find_experiment("turning").scores(table).rows.at(1).size(), 5U);
}

TEST(ToolExperiment, NamesTheNearestOfItsCases) {
  EXPECT_TRUE(
      test::fails_saying([] { return run_of("groov"); }, "tool has no such case", "groove"));
}

}  // namespace test_tool
}  // namespace palpate::lab
