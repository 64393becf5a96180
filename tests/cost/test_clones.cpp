// SPDX-License-Identifier: Apache-2.0
#include <cmath>
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

// Sums of some hundred unit vectors in another order: floats differ by 1e-7 of the terms' sum.
constexpr double rounding = 2e-5;
// The same for what is a single length [m], and for a mean of them.
constexpr double nanometres = 5e-9;

void expect_same(const Probe& a, const Probe& b) {
  EXPECT_EQ(a.points, b.points);
  EXPECT_GT(std::accumulate(a.points.begin(), a.points.end(), std::size_t{0}), 5000U)
      << "the clones must not agree because they found nothing";
  ASSERT_EQ(a.sums.size(), b.sums.size());
  for (std::size_t i = 0; i < a.sums.size(); ++i) {
    const std::size_t figure = i % 9;
    const bool is_sum = figure >= 3 && figure < 6;
    // A grazing ray's travel depends on the root of what is nearly nothing.
    const double tolerance = is_sum ? rounding : figure == 7 ? 1e-6 : nanometres;
    EXPECT_NEAR(a.sums[i], b.sums[i], tolerance) << "gather " << i / 9 << ", figure " << figure;
  }
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
