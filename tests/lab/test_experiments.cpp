// SPDX-License-Identifier: Apache-2.0
// The paper's figures at reduced size, and that an experiment is the same however it is run.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "lab/experiment.hpp"
#include "lab/method.hpp"
#include "lab/report.hpp"
#include "lab/runner.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_experiments {

namespace fs = std::filesystem;

class Lab : public ::testing::Test {
 protected:
  [[nodiscard]] Table run(std::string_view name, const ExperimentOptions& options) const {
    return {name, csv(name, options, 2)};
  }

  [[nodiscard]] std::string csv(std::string_view name, const ExperimentOptions& options, int jobs,
                                bool resume = false) const {
    RunnerOptions runner;
    runner.jobs = jobs;
    runner.resume = resume;
    return run_experiment(find_experiment(name), options, runner, file(name));
  }

  [[nodiscard]] fs::path file(std::string_view name) const {
    return folder_.path() / (std::string(name) + ".csv");
  }

 private:
  test::TemporaryFolder folder_;
};

ExperimentOptions with(std::vector<std::string> methods) {
  ExperimentOptions options;
  options.methods = std::move(methods);
  return options;
}

TEST_F(Lab, LosesNoQuietLiftBelow880AndHoldsNoneAbove920) {
  ExperimentOptions options = with({"paper"});
  options.grid = {1, 71};  // without noise, 0 to 1400 r_c/s^2 in steps of 20
  const Table table = run("lift", options);
  ASSERT_EQ(table.rows(), 71U);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const double a = table.number(row, "acceleration_rc");
    const double popped = table.number(row, "popped");
    EXPECT_TRUE(a > 880.0 || popped == 0.0) << a;
    EXPECT_TRUE(a < 920.0 || popped == 1.0) << a;
  }
}

TEST_F(Lab, HoldsMoreOfTheLiftsThanTheFixedStepMethod) {
  ExperimentOptions options = with({"fixed-step", "paper"});
  options.grid = {6, 8};
  const Table table = run("lift", options);
  const auto lost = [&](std::string_view method) {
    double sum = 0.0;
    for (const double p : table.numbers(
             "popped", [&](std::size_t row) { return table.text(row, "method") == method; }))
      sum += p;
    return sum;
  };
  EXPECT_LT(lost("paper") + 8, lost("fixed-step"));
}

TEST_F(Lab, RipplesByAHundredthOfARadiusOnAFlatGrid) {
  const Table table = run("flat", with({"paper"}));
  double low = 1.0;
  double high = -1.0;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const double t = table.number(row, "t");
    if (t < 1.2 || t > 3.9) continue;
    low = std::min(low, table.number(row, "contact_y"));
    high = std::max(high, table.number(row, "contact_y"));
  }
  // Between four points r_c - sqrt(r_c^2 - s^2/2) = 0.114 mm; half of it is 0.011 r_c.
  EXPECT_NEAR(0.5 * (high - low) / 5e-3, 0.011, 0.003);
}

TEST_F(Lab, StaysAboveTheLiftOfFig12ThatTheFixedStepMethodLoses) {
  const Table table = run("single-lift", with({"paper", "fixed-step"}));
  double least = 1.0;
  double last_of_fixed_step = 1.0;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (table.number(row, "true_y") < 0.0) continue;
    const double above = table.number(row, "proxy_y") - table.number(row, "cloud_y");
    if (table.text(row, "method") == "paper") least = std::min(least, above);
    if (table.text(row, "method") == "fixed-step") last_of_fixed_step = above;
  }
  EXPECT_GT(least, 0.0);
  EXPECT_LT(last_of_fixed_step, 0.0);
}

TEST_F(Lab, NeverLosesALiftOfTheRuler) {
  ExperimentOptions options = with({"ideal"});
  options.grid = {2, 3};
  const Table table = run("lift", options);
  for (std::size_t row = 0; row < table.rows(); ++row) EXPECT_EQ(table.number(row, "popped"), 0.0);
}

TEST_F(Lab, TouchesCornersAsWellAsASphereCan) {
  const Table table = run("corners", with({"paper", "sight", "ideal"}));
  for (const auto& [method, most] :
       {std::pair{"paper", 0.3e-3}, std::pair{"sight", 0.3e-3}, std::pair{"ideal", 1e-5}}) {
    double squares = 0.0;
    int count = 0;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      if (table.text(row, "method") != method) continue;
      squares += std::pow(table.number(row, "gap"), 2);
      ++count;
    }
    ASSERT_GT(count, 0) << method;
    EXPECT_LT(std::sqrt(squares / count), most) << method;
  }
}

TEST_F(Lab, MeasuresNoErrorOfTheRulerAndThePaperLostInARealCamerasNoise) {
  ExperimentOptions options = with({"paper", "ideal"});
  options.grid = {2, 2};
  const Table table = run("fidelity", options);
  const auto value = [&](std::string_view method, std::string_view scene,
                         std::string_view measure) {
    const std::vector<double> values = table.numbers("value", [&](std::size_t row) {
      return table.text(row, "method") == method && table.text(row, "scene") == scene &&
             table.text(row, "measure") == measure;
    });
    return values.empty() ? -1.0 : values.front();
  };
  int measured = 0;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (table.text(row, "method") != "ideal") continue;
    ++measured;
    // The ruler steps to within a few micrometres of where a relief is steepest.
    EXPECT_LT(table.number(row, "value"), 1e-5)
        << table.text(row, "scene") << ' ' << table.text(row, "measure");
  }
  EXPECT_EQ(measured, 26);
  // 2.1 of the noise's extremes: the paper's proxy rests on them.
  EXPECT_GT(value("paper", "white-1mm", "bias"), 0.5);
  EXPECT_EQ(value("paper", "white-1mm", "lost"), 0.0);
  EXPECT_EQ(value("paper", "real-0.95m", "lost"), 100.0);
  EXPECT_EQ(value("paper", "real-0.95m", "rms"), -1.0) << "nothing is known of what was lost";
  // The sphere between four points of a grid, as in Fig. 11.
  EXPECT_NEAR(value("paper", "quiet-plane", "largest"), 0.114, 0.03);

  const Scores scores = find_experiment("fidelity").scores(table);
  EXPECT_EQ(scores.rows.back().back(), "24") << "aims met by the ruler";
  EXPECT_LT(std::stoi(scores.rows.back()[3]), 8) << "and by the paper";
}

TEST_F(Lab, PlaysAndJudgesOnlyTheScenesOfFidelityThatAreAskedFor) {
  ExperimentOptions options = with({"ideal"});
  options.families = {"sine"};
  const Table table = run("fidelity", options);
  ASSERT_EQ(table.rows(), 2U);
  EXPECT_EQ(table.text(0, "scene"), "sine");
  const Scores scores = find_experiment("fidelity").scores(table);
  ASSERT_EQ(scores.rows.size(), 3U);
  EXPECT_EQ(scores.rows.back(), (std::vector<std::string>{"aims met", "", "2", "2"}));
  const Experiment& fidelity = find_experiment("fidelity");
  const auto open = [&] { return fidelity.cells(fidelity, options).size(); };
  options.families = {"sinus"};
  EXPECT_TRUE(test::fails_saying(open, "--families sinus", "did you mean 'sine'? known here: "));
  options.families = {"unheard-of"};
  EXPECT_TRUE(test::fails_saying(open, "no such scene; known here: white-1mm, correlated-1mm"));
}

TEST_F(Lab, GivesTheSameBytesWithOneJobTwoJobsAndAfterAnInterruption) {
  ExperimentOptions options = with({"paper"});
  options.grid = {3, 4};
  const std::string one = csv("lift", options, 1);
  EXPECT_EQ(csv("lift", options, 2), one);
  options.seed = 2;
  EXPECT_NE(csv("lift", options, 2), one);
  options.seed = 1;

  // A run that was killed while it wrote its sixth cell: what the progress callback throws ends it.
  RunnerOptions runner;
  runner.progress = [](std::size_t done, std::size_t) {
    if (done == 5) throw Error("test", "interrupted");
  };
  EXPECT_THROW(run_experiment(find_experiment("lift"), options, runner, file("lift")), Error);
  std::ofstream(file("lift").string() + ".part", std::ios::app) << "5 400\npaper,46";
  std::size_t first_done = 0;
  runner.resume = true;
  runner.progress = [&](std::size_t done, std::size_t) {
    if (first_done == 0) first_done = done;
  };
  EXPECT_EQ(run_experiment(find_experiment("lift"), options, runner, file("lift")), one);
  EXPECT_EQ(first_done, 6U) << "five cells were kept";
  EXPECT_FALSE(fs::exists(file("lift").string() + ".part"));
}

TEST_F(Lab, RefusesToResumeARunWithOtherOptions) {
  ExperimentOptions options = with({"paper"});
  options.grid = {1, 3};
  RunnerOptions runner;
  runner.progress = [](std::size_t, std::size_t) { throw Error("test", "interrupted"); };
  EXPECT_THROW(run_experiment(find_experiment("lift"), options, runner, file("lift")), Error);
  options.seed = 7;
  runner.resume = true;
  runner.progress = nullptr;
  EXPECT_THROW(run_experiment(find_experiment("lift"), options, runner, file("lift")), Error);
}

TEST_F(Lab, WritesClaimsAndScoresIntoTablesOfTheirOwn) {
  const Result flat = make_result(find_experiment("flat"), {}, csv("flat", {}, 2));
  ASSERT_EQ(flat.claims.size(), 1U);
  EXPECT_EQ(flat.claims[0].verdict.substr(0, 10), "reproduced");
  const auto text_of = [&](const char* name) {
    std::ifstream in(file("flat").replace_filename(name));
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  write_report({flat}, file("flat").parent_path());
  EXPECT_EQ(text_of("bench.md"), "") << "no bench was run";
  Result pop{.experiment = &find_experiment("pop"), .command = "palpate eval pop"};
  pop.scores = Scores{.columns = {"method"}, .rows = {{"sight"}}, .note = ""};
  write_report({pop, flat}, file("flat").parent_path());
  EXPECT_NE(text_of("reproduction.md").find("amplitude of this periodic"), std::string::npos);
  EXPECT_EQ(text_of("reproduction.md").find("sight |"), std::string::npos);
  EXPECT_NE(text_of("bench.md").find("| sight |"), std::string::npos);
}

TEST(Methods, AreFoundByNameAndTheNearestIsSuggested) {
  try {
    static_cast<void>(make_method("papr", {}));
    FAIL() << "there is no such method";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("did you mean 'paper'"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("ideal"), std::string::npos);
  }
  EXPECT_THROW(find_experiment("lifts!"), Error);
  EXPECT_THROW(static_cast<void>(make_method("ideal", {})), Error) << "it needs the truth";
}

TEST(Ideal, RestsOnASphereWhereTheHipIs) {
  constexpr double radius = 0.05;
  const Truth sphere = [](const Vec3& p, double) {
    return TruePoint{p.norm() - radius, p.normalized()};
  };
  const auto ideal = make_method("ideal", {Parameters{}, sphere});
  ideal->seat({0, 0.02, 0.08});
  const Vec3 direction = Vec3(0.3, -0.2, 1.0).normalized();
  Tick tick{};
  for (int i = 0; i < 200; ++i) tick = ideal->tick(0.04 * direction, i * 1e-3);
  EXPECT_LT((tick.proxy - (radius + 5e-3) * direction).norm(), 1e-6);
  EXPECT_LT((tick.force - 600.0 * 0.010 * direction).norm(), 1e-3);
}

TEST(Direct, PushesInProportionToTheDepthBelowAPlane) {
  const PointCloud plane(test::flat_grid(), Vec3(0, 0, 1));
  const auto direct = make_method("direct", {});
  direct->observe({plane, 0.0});
  EXPECT_NEAR(direct->tick({0, 0, -0.004}, 0.0).force.z(), 600.0 * 0.004, 1e-6);
  EXPECT_NEAR(direct->tick({0, 0, -0.008}, 0.0).force.z(), 600.0 * 0.008, 1e-6);
  EXPECT_TRUE(direct->tick({0, 0, 0.004}, 0.0).force.isZero());
}

}  // namespace test_experiments
}  // namespace palpate::lab
