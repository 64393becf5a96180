// SPDX-License-Identifier: Apache-2.0
// The experiment `splat`: a body of clean Gaussians is felt as the analytic one.
#include <gtest/gtest.h>

#include "lab/experiment.hpp"
#include "lab/runner.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_splat {

TEST(SplatExperiment, ACleanBallIsAsTheTrueOneAllRound) {
  ExperimentOptions options;
  options.families = {"clean"};
  options.methods = {"sight"};
  RunnerOptions runner;
  runner.jobs = 2;
  const test::TemporaryFolder folder;
  const Experiment& splat = find_experiment("splat");
  const Table table("splat", run_experiment(splat, options, runner, folder.path() / "splat.csv"));
  ASSERT_EQ(table.rows(), 2U);
  EXPECT_EQ(table.text(0, "body"), "ball");
  EXPECT_GT(table.number(0, "held"), 0.99);
  EXPECT_LT(table.number(0, "error"), 0.05);
  EXPECT_LT(table.number(0, "rest_n"), 0.01);
  EXPECT_EQ(splat.scores(table).rows.at(1).size(), splat.scores(table).columns.size());
  options.families = {"cleen"};
  EXPECT_TRUE(test::fails_saying([&] { return splat.cells(splat, options); }, "'clean'"));
}

}  // namespace test_splat
}  // namespace palpate::lab
