// SPDX-License-Identifier: Apache-2.0
// Eigen's decompositions, compiled here alone: each takes seconds in every file that uses it.
#pragma once

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// The axes of a symmetric matrix.
struct Axes {
  Vec3 values;              ///< eigenvalues, the least first
  Eigen::Matrix3d vectors;  ///< a column each
};
Axes axes_of(const Eigen::Matrix3d& symmetric) noexcept;

/// Solves a x = b by LDL^T, for n = 3, 5 and 6.
/// @param a  symmetric, not negative
template <int n>
Eigen::Matrix<double, n, 1> solve_symmetric(const Eigen::Matrix<double, n, n>& a,
                                            const Eigen::Matrix<double, n, 1>& b) noexcept;

/// The x of the least |a x - b|, by QR. Allocates.
Eigen::VectorXd least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

}  // namespace palpate
