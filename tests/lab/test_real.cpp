// SPDX-License-Identifier: Apache-2.0
// Touching what was recorded: the ruler on moved patches, and methods on a real camera's frames.
#include <memory>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "lab/experiment.hpp"
#include "lab/method.hpp"
#include "lab/runner.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/data.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_real {

// Never has a force.
class Numb final : public LabMethod {
 public:
  explicit Numb(const Parameters& parameters) : LabMethod(parameters) {}
  Tick tick(const Vec3& hip, double t) noexcept override { return free(hip, t); }
};

Table touch(const std::string& method, const std::string& recording,
            std::optional<int> cases = std::nullopt) {
  const test::TemporaryFolder folder;
  ExperimentOptions options;
  options.methods = {method};
  options.recording = recording;
  options.cases = cases;
  options.own_methods = {
      {"numb", [](const MethodSetup& setup) { return std::make_unique<Numb>(setup.parameters); }}};
  const std::string csv =
      run_experiment(find_experiment("real"), options, {}, folder.path() / "real.csv");
  return {"real", csv};
}

double sum(const Table& table, std::string_view column, std::string_view action) {
  double total = 0.0;
  for (const double value :
       table.numbers(column, [&](std::size_t row) { return table.text(row, "action") == action; }))
    total += value;
  return total;
}

TEST(Real, TheRulerFollowsWhatIsMovedExactly) {
  const Table table = touch("ideal", "synthetic:desk?sensor=d4xx&frames=4");
  ASSERT_EQ(table.rows(), 32U) << "four actions at eight places";
  for (std::size_t row = 0; row < table.rows(); ++row) {
    EXPECT_EQ(table.number(row, "lost"), 0.0) << row;
    EXPECT_LT(table.number(row, "error_mm"), 1e-6) << row;
  }
}

TEST(Real, ThePaperLosesWhatAnotherPatchSweepsOver) {
  // No noise: what it loses, it loses to the sweep.
  const Table table = touch("paper", "synthetic:plane?frames=2");
  EXPECT_EQ(sum(table, "lost", "hold"), 0.0);
  EXPECT_EQ(sum(table, "lost", "moving"), 0.0);
  EXPECT_EQ(sum(table, "lost", "sweep"), 8.0);
}

TEST(Real, MovesNothingWhereTheCameraMoves) {
  // A plane that comes nearer by 0.3 m/s is as good as a camera that does.
  const Table table = touch("sight", "synthetic:plane?speed=0.3&frames=8");
  ASSERT_GT(table.rows(), 0U);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    EXPECT_TRUE(table.text(row, "action") == "hold" || table.text(row, "action") == "slide");
  }
}

TEST(Real, PressesAndStrokesWhereTheNewestFrameShowsTheSurface) {
  const std::string recording = "synthetic:plane?speed=0.3&frames=8";  // as from a moving camera
  const Table ideal = touch("ideal", recording, 3);
  ASSERT_EQ(ideal.rows(), 6U) << "two actions at three positions";
  for (std::size_t row = 0; row < ideal.rows(); ++row) {
    EXPECT_EQ(ideal.text(row, "action"), row < 3 ? "press" : "stroke");
    EXPECT_EQ(ideal.number(row, "lost"), 0.0) << row;
    EXPECT_LT(ideal.number(row, "error_mm"), 0.01) << row;
    EXPECT_GT(ideal.number(row, "step_n"), 0.0) << row;
  }
  const Table numb = touch("numb", recording, 3);
  for (const char* action : {"press", "stroke"}) EXPECT_EQ(sum(numb, "lost", action), 3.0);
}

TEST(Real, SaysWhatIsMissing) {
  EXPECT_THROW(touch("paper", "synthetic:plane?distance=3&frames=2", 1), Error) << "all too far";

  EXPECT_THROW(touch("paper", "synthetic:plane?distance=3&frames=2"), Error) << "all too far";
  EXPECT_THROW(touch("paper", "depth:/nowhere"), Error);
}

TEST(Real, SightHoldsMoreOfARealTableThanThePaper) {
  PALPATE_DATA_OR_SKIP(folder, "seq_visp_tabletop_known_objects");
  const std::string recording = "depth:" + folder.string() + "?frames=8";
  const Table paper = touch("paper", recording);
  const Table sight = touch("sight", recording);
  for (const char* action : {"hold", "moving", "sweep"})
    EXPECT_LT(sum(sight, "lost", action) + 2.0, sum(paper, "lost", action)) << action;
}

}  // namespace test_real
}  // namespace palpate::lab
