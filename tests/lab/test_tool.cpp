// SPDX-License-Identifier: Apache-2.0
// The experiment `tool`: the shape is where the truth is, and a penalty is not.
#include <gtest/gtest.h>

#include "lab/experiment.hpp"
#include "lab/runner.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_tool {

Table run_of(const std::string& name, const std::string& experiment = "tool") {
  ExperimentOptions options;
  options.families = {name};
  options.cases = 1;
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

TEST(ToolExperiment, APlateStaysBeforeASurfaceThatComesAndAPenaltyDoesNot) {
  const Table table = run_of("coming");
  for (const char* camera : {"ideal", "d4xx"}) {
    EXPECT_LT(value(table, camera, "shape", "behind"), 0.1) << camera;
    EXPECT_GT(value(table, camera, "penalty", "behind"), 0.3) << camera;
    EXPECT_GT(value(table, camera, "voxels", "behind"), 0.3) << camera;
  }
  EXPECT_EQ(find_experiment("tool").scores(table).rows[0][3], "-") << "no truth of forces there";
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
