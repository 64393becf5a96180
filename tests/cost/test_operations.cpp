// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "bench/costs.hpp"

namespace palpate::bench {
namespace test_operations {

// Counts do not depend on the clock; how many ticks are run does, a little.
constexpr double budget = 0.02;

KernelCosts slide(const Subject& subject, double depth = 0.005) {
  return kernel_costs(subject, {.name = "paper"}, Hand{.depth = depth}, budget);
}

TEST(Cost, ASlideTakesFewStepsAndGathersNotMuchMoreThanOnceAFrame) {
  const KernelCosts costs = slide(noisy_plane(640, 480, 525.0, 1.0));
  EXPECT_LT(costs.steps, 16.0);
  EXPECT_LT(costs.gathers, 0.5) << "a patch serves many ticks: 33 of them share a frame";
  EXPECT_LT(costs.points, 250.0) << "a patch reaches little farther than r_3";
}

TEST(Cost, PointsOfAPatchDoNotDependOnTheSizeOfTheImage) {
  const KernelCosts small = slide(noisy_plane(160, 120, 525.0, 1.0));
  const KernelCosts large = slide(noisy_plane(1280, 960, 525.0, 1.0));
  EXPECT_NEAR(large.points, small.points, 0.3 * small.points);
}

TEST(Cost, FreeMotionTakesOneStepATick) {
  const KernelCosts costs = slide(noisy_plane(640, 480, 525.0, 1.0), -0.03);
  EXPECT_LE(costs.steps, 1.01);
}

TEST(Cost, EveryMethodFindsTheSamePoints) {
  const Subject subject = noisy_plane(320, 240, 262.5, 0.5);
  const auto rows = search_costs(subject, Parameters{}, 0.0);
  ASSERT_GE(rows.size(), 4U);  // and PCL's, where it is installed
  EXPECT_GT(rows[0].found, 20U);
  // PCL calculates in float: on the rim it may round differently.
  for (const SearchCosts& row : rows) {
    const double slack = row.name.starts_with("PCL") ? 2.0 : 0.0;
    EXPECT_NEAR(static_cast<double>(row.found), static_cast<double>(rows.back().found), slack)
        << row.name;
  }
}

}  // namespace test_operations
}  // namespace palpate::bench
