// SPDX-License-Identifier: Apache-2.0
// Decompositions. Those by Eigen are compiled here alone: each takes seconds in every file that
// uses it.
#pragma once

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// The axes of a symmetric matrix.
struct Axes {
  Vec3 values;              ///< eigenvalues, the least first
  Eigen::Matrix3d vectors;  ///< a column each
};
Axes axes_of(const Eigen::Matrix3d& symmetric) noexcept;
struct Axes6 {
  Eigen::Matrix<double, 6, 1> values;
  Eigen::Matrix<double, 6, 6> vectors;
};
/// By Jacobi's rotations.
Axes6 axes_of_six(Eigen::Matrix<double, 6, 6> symmetric) noexcept;

/// Solves a x = b by LDL^T, for n = 3, 5 and 6.
/// @param a  symmetric, not negative
template <int n>
Eigen::Matrix<double, n, 1> solve_symmetric(const Eigen::Matrix<double, n, n>& a,
                                            const Eigen::Matrix<double, n, 1>& b) noexcept;

/// The x of the least |columns x - right|, by QR; 0 for a column that those before it make up.
/// Allocates.
Eigen::VectorXd least_squares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& right);

}  // namespace palpate
