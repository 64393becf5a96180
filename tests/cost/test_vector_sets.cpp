// SPDX-License-Identifier: Apache-2.0
#include <numeric>
#include <string>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/vectorise.hpp"

#include "tests/cost/probe.hpp"

namespace palpate {
namespace test_vector_sets {

class VectorSets : public ::testing::Test {
 protected:
  void TearDown() override { use_vector_set(vector_sets().back()); }
};

TEST_F(VectorSets, AllGiveTheSameToTheBit) {
  use_vector_set(vector_sets().front());
  const Probe base = probe();
  EXPECT_GT(std::accumulate(base.points.begin(), base.points.end(), std::size_t{0}), 5000U)
      << "the sets must not agree because they found nothing";
  for (const std::string_view set : vector_sets()) {
    use_vector_set(set);
    EXPECT_EQ(vector_set_in_use(), set);
    const Probe here = probe();
    EXPECT_EQ(here.points, base.points) << set;
    ASSERT_EQ(here.sums.size(), base.sums.size());
    for (std::size_t i = 0; i < base.sums.size(); ++i)
      EXPECT_EQ(here.sums[i], base.sums[i]) << set << ", gather " << i / 9 << ", figure " << i % 9;
  }
}

TEST_F(VectorSets, OneThatIsNotThereIsRefusedWithThoseThatAre) {
  try {
    use_vector_set("neon");
    FAIL() << "there is no set neon";
  } catch (const Error& error) {
    const std::string why = error.what();
    for (const std::string_view set : vector_sets())
      EXPECT_NE(why.find(set), std::string::npos) << why;
  }
  EXPECT_EQ(vector_set_in_use(), vector_sets().back());
}

}  // namespace test_vector_sets
}  // namespace palpate
