// SPDX-License-Identifier: Apache-2.0
#include <random>

#include <gtest/gtest.h>

#include "palpate/kernel/core/linear.hpp"

namespace palpate {
namespace test_linear {

using Mat6 = Eigen::Matrix<double, 6, 6>;

void expect_axes_of(const Mat6& matrix) {
  const Axes6 axes = axes_of_six(matrix);
  const double size = matrix.norm() + 1e-300;
  const Mat6 product = axes.vectors * axes.values.asDiagonal() * axes.vectors.transpose();
  EXPECT_LT((product - matrix).norm(), 1e-13 * size) << matrix;
  EXPECT_LT((axes.vectors.transpose() * axes.vectors - Mat6::Identity()).norm(), 1e-13);
  for (int i = 1; i < 6; ++i) EXPECT_LE(axes.values[i - 1], axes.values[i]);
}

TEST(AxesOfSix, MakeUpTheMatrix) {
  std::mt19937 random(1);
  std::normal_distribution<double> number;
  for (int n = 0; n < 200; ++n) {
    Mat6 half;
    for (int i = 0; i < 36; ++i) half(i / 6, i % 6) = number(random);
    const double ill = n % 2 == 0 ? 1.0 : 1e-6;  // one axis nearly open
    half.col(2) *= ill;
    expect_axes_of(half * half.transpose());
    expect_axes_of(half + half.transpose());
  }
  expect_axes_of(Mat6::Zero());
  expect_axes_of(Mat6::Identity());
  expect_axes_of(Mat6::Ones());
}

TEST(LeastSquares, LeaveARestAcrossTheColumns) {
  std::mt19937 random(2);
  std::normal_distribution<double> number;
  for (int n = 0; n < 100; ++n) {
    Eigen::MatrixXd a(20, 4);
    Eigen::VectorXd b(20);
    for (int i = 0; i < 20; ++i) {
      b[i] = number(random);
      for (int j = 0; j < 4; ++j) a(i, j) = number(random) + (j == 3 ? 1e3 : 0.0);
    }
    const Eigen::VectorXd x = least_squares(a, b);
    const Eigen::VectorXd rest = a * x - b;
    EXPECT_LT((a.transpose() * rest).norm(), 1e-9 * b.norm() * a.norm());
  }
}

TEST(LeastSquares, LeaveOutAColumnThatOthersMakeUp) {
  Eigen::MatrixXd a(3, 3);
  a << 1, 2, 0, 0, 0, 1, 0, 0, 1;
  Eigen::VectorXd b(3);
  b << 3, 4, 4;
  const Eigen::VectorXd x = least_squares(a, b);
  EXPECT_DOUBLE_EQ(x[0], 3.0);
  EXPECT_EQ(x[1], 0.0);
  EXPECT_DOUBLE_EQ(x[2], 4.0);
}

}  // namespace test_linear
}  // namespace palpate
