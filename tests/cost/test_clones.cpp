// SPDX-License-Identifier: Apache-2.0
#include <numeric>

#include <gtest/gtest.h>

#include "tests/cost/probe.hpp"

namespace palpate_default {
Probe probe();
}
namespace palpate_avx2 {
Probe probe();
}
namespace palpate_avx512f {
Probe probe();
}

namespace test_clones {

void expect_same(const Probe& a, const Probe& b) {
  EXPECT_EQ(a.points, b.points);
  EXPECT_GT(std::accumulate(a.points.begin(), a.points.end(), std::size_t{0}), 5000U)
      << "the clones must not agree because they found nothing";
  ASSERT_EQ(a.sums.size(), b.sums.size());
  for (std::size_t i = 0; i < a.sums.size(); ++i)
    EXPECT_EQ(a.sums[i], b.sums[i]) << "gather " << i / 9 << ", figure " << i % 9;
}

#if defined(__x86_64__) && defined(__linux__)
TEST(Cost, Avx2AgreesWithTheBaseline) {
  if (!__builtin_cpu_supports("avx2")) GTEST_SKIP() << "this processor has no AVX2";
  expect_same(palpate_avx2::probe(), palpate_default::probe());
}

TEST(Cost, Avx512AgreesWithTheBaseline) {
  if (!__builtin_cpu_supports("avx512f")) GTEST_SKIP() << "this processor has no AVX-512";
  expect_same(palpate_avx512f::probe(), palpate_default::probe());
}
#endif

}  // namespace test_clones
