// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "palpate/kernel/core/lanes.hpp"
#include "palpate/kernel/core/mathematics.hpp"

namespace palpate {
namespace test_mathematics {

// The largest error of `ours` from `low` to `high`, in units of the last place of the result.
template <class Ours, class Exact>
double worst(const Ours& ours, const Exact& exact, double low, double high) {
  std::mt19937_64 random(1);
  double most = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const double x = low + (high - low) * 0x1p-53 * static_cast<double>(random() >> 11U);
    const auto expected = static_cast<double>(exact(static_cast<long double>(x)));
    const double size = std::abs(expected);
    const double unit = std::nextafter(size, std::numeric_limits<double>::max()) - size;
    most = std::max(most, std::abs(ours(x) - expected) / unit);
  }
  return most;
}

TEST(Mathematics, IsExactToTheLastPlaces) {
  if (std::getenv("PALPATE_MEMCHECK") != nullptr)
    GTEST_SKIP() << "valgrind computes long doubles with 64 bits";
  const auto exp = [](double x) { return math::exp(x); };
  const auto exact_exp = [](long double x) { return std::exp(x); };
  EXPECT_LE(worst(exp, exact_exp, -1.0, 1.0), 2.0);
  EXPECT_LE(worst(exp, exact_exp, -700.0, 700.0), 2.0);
  const auto expm1 = [](double x) { return math::expm1(x); };
  const auto exact_expm1 = [](long double x) { return std::expm1(x); };
  EXPECT_LE(worst(expm1, exact_expm1, -1e-3, 1e-3), 2.0);
  EXPECT_LE(worst(expm1, exact_expm1, -3.0, 1.0), 4.0);
  const auto log = [](double x) { return math::log(x); };
  const auto exact_log = [](long double x) { return std::log(x); };
  EXPECT_LE(worst(log, exact_log, 0.5, 2.0), 2.0);
  EXPECT_LE(worst(log, exact_log, 1e-300, 1e-290), 2.0);
  EXPECT_LE(worst(log, exact_log, 1.0, 1e9), 2.0);
  for (const double range : {4.0, 1000.0}) {
    EXPECT_LE(worst([](double x) { return math::sin(x); },
                    [](long double x) { return std::sin(x); }, -range, range),
              2.0);
    EXPECT_LE(worst([](double x) { return math::cos(x); },
                    [](long double x) { return std::cos(x); }, -range, range),
              2.0);
  }
  EXPECT_LE(
      worst([](double x) { return math::hypot(x, 0.3); },
            [](long double x) { return std::hypot(x, static_cast<long double>(0.3)); }, -1.0, 1.0),
      2.0);
  EXPECT_LE(
      worst([](double x) { return math::pow(x, 2.4); },
            [](long double x) { return std::pow(x, static_cast<long double>(2.4)); }, 0.01, 1.0),
      16.0);
  for (double c = -1.0; c <= 1.0; c += 1e-3) EXPECT_NEAR(math::acos(c), std::acos(c), 1e-15) << c;
}

TEST(Mathematics, HasItsLimits) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(math::exp(0.0), 1.0);
  EXPECT_EQ(math::exp(-800.0), 0.0);
  EXPECT_GT(math::exp(-744.0), 0.0);
  EXPECT_EQ(math::exp(710.0), infinite);
  EXPECT_TRUE(std::isnan(math::exp(std::nan(""))));
  EXPECT_EQ(math::log(0.0), -infinite);
  EXPECT_EQ(math::log(infinite), infinite);
  EXPECT_TRUE(std::isnan(math::log(-1.0)));
  EXPECT_NEAR(math::log(5e-324), std::log(5e-324), 1e-12);
  EXPECT_EQ(math::acos(1.0), 0.0);
  EXPECT_EQ(math::acos(-1.0), std::numbers::pi);
  EXPECT_EQ(math::pow(0.0, 2.4), 0.0);
}

TEST(Lanes, AddInOneOrder) {
  FloatLanes lanes;
  for (std::size_t i = 0; i < lanes.size(); ++i) lanes[i] = 1.0F / static_cast<float>(i + 1);
  const auto pair = [&](std::size_t i) { return lanes[i] + lanes[i + 8]; };
  const auto four = [&](std::size_t i) { return pair(i) + pair(i + 4); };
  EXPECT_EQ(sum_of_lanes(lanes), (four(0) + four(2)) + (four(1) + four(3)));
  EXPECT_EQ(least_of_lanes(lanes), 1.0F / 16.0F);
}

TEST(Lanes, SumWhatDoesNotFillThem) {
  for (const std::size_t size : {0U, 1U, 15U, 16U, 17U, 100U}) {
    const auto [sum, squares] = sums_over<2>(size, [](std::size_t i) {
      const auto x = static_cast<double>(i);
      return std::array{x, x * x};
    });
    const auto n = static_cast<double>(size);
    EXPECT_EQ(sum, n * (n - 1.0) / 2.0) << size;
    EXPECT_EQ(squares, n * (n - 1.0) * (2.0 * n - 1.0) / 6.0) << size;
  }
}

}  // namespace test_mathematics
}  // namespace palpate
