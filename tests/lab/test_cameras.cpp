// SPDX-License-Identifier: Apache-2.0
// The experiment `cameras`: two cameras are never worse for a hand at rest than the better one.
#include <algorithm>

#include <gtest/gtest.h>

#include "lab/experiment.hpp"
#include "lab/runner.hpp"

#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_cameras {

Table felt(std::vector<std::string> rigs, int seeds) {
  ExperimentOptions options;
  options.methods = {"sight"};
  options.families = std::move(rigs);
  options.cases = seeds;
  RunnerOptions runner;
  runner.jobs = 2;
  const test::TemporaryFolder folder;
  const Experiment& cameras = find_experiment("cameras");
  Table table("cameras", run_experiment(cameras, options, runner, folder.path() / "cameras.csv"));
  EXPECT_EQ(table.rows(), options.families.size());
  const Scores scores = cameras.scores(table);
  for (const auto& row : scores.rows) EXPECT_EQ(row.size(), scores.columns.size());
  return table;
}

TEST(SeveralCameras, AreStillerThanTheBestOfThemAlone) {
  const Table table = felt({"in-turn", "at-once", "near-far"}, 10);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    EXPECT_LE(table.number(row, "both"),
              std::min(table.number(row, "first"), table.number(row, "second")))
        << table.text(row, "rig");
    EXPECT_LT(table.number(row, "weighed"), table.number(row, "first")) << "else it is no optimum";
  }
}

TEST(SeveralCameras, GoOnWhereTheyDisagreeOrOneIsBlinded) {
  const Table table = felt({"3mm-apart", "one-blinded"}, 3);
  EXPECT_LE(table.number(0, "both"),
            1.5 * std::max(table.number(0, "first"), table.number(0, "second")));
  EXPECT_EQ(table.number(1, "first_hidden"), 1.0);
  EXPECT_EQ(table.number(1, "hidden"), 0.0);
  EXPECT_LE(table.number(1, "both"), 1.5 * table.number(1, "second"));
}

}  // namespace test_cameras
}  // namespace palpate::lab
