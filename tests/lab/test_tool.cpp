// SPDX-License-Identifier: Apache-2.0
// The experiment `tool`: the shape is where the truth is, and a penalty is not.
#include <gtest/gtest.h>

#include "lab/experiment.hpp"
#include "lab/runner.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_tool {

Table run_of(const std::string& name) {
  ExperimentOptions options;
  options.families = {name};
  options.cases = 1;
  RunnerOptions runner;
  runner.jobs = 2;
  const test::TemporaryFolder folder;
  const Experiment& tool = find_experiment("tool");
  return {"tool", run_experiment(tool, options, runner, folder.path() / "tool.csv")};
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
  ASSERT_EQ(table.rows(), 4U);
  for (const char* camera : {"ideal", "d4xx"}) {
    EXPECT_NEAR(value(table, camera, "shape", "force"), 3.0, 1e-3) << "600 N/m by 5 mm";
    EXPECT_LT(value(table, camera, "shape", "force_error"), 0.05) << camera;
    EXPECT_GT(value(table, camera, "penalty", "force_error"), 0.2) << camera;
    EXPECT_EQ(value(table, camera, "shape", "behind"), 0.0) << camera;
  }
  EXPECT_LT(value(table, "ideal", "shape", "torque_error"), 0.05);
  const Experiment& tool = find_experiment("tool");
  const Scores scores = tool.scores(table);
  ASSERT_EQ(scores.rows.size(), 4U);
  EXPECT_EQ(scores.rows[0].size(), scores.columns.size());
}

TEST(ToolExperiment, APlateStaysBeforeASurfaceThatComesAndAPenaltyDoesNot) {
  const Table table = run_of("coming");
  for (const char* camera : {"ideal", "d4xx"}) {
    EXPECT_LT(value(table, camera, "shape", "behind"), 0.1) << camera;
    EXPECT_GT(value(table, camera, "penalty", "behind"), 0.3) << camera;
  }
  EXPECT_EQ(find_experiment("tool").scores(table).rows[0][3], "-") << "no truth of forces there";
}

TEST(ToolExperiment, NamesTheNearestOfItsCases) {
  EXPECT_TRUE(
      test::fails_saying([] { return run_of("groov"); }, "tool has no such case", "groove"));
}

}  // namespace test_tool
}  // namespace palpate::lab
