// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/linear.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace palpate {

Axes axes_of(const Eigen::Matrix3d& symmetric) noexcept {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

template <int n>
Eigen::Matrix<double, n, 1> solve_symmetric(const Eigen::Matrix<double, n, n>& a,
                                            const Eigen::Matrix<double, n, 1>& b) noexcept {
  return a.ldlt().solve(b);
}

template Eigen::Vector3d solve_symmetric<3>(const Eigen::Matrix3d&,
                                            const Eigen::Vector3d&) noexcept;
template Eigen::Matrix<double, 5, 1> solve_symmetric<5>(
    const Eigen::Matrix<double, 5, 5>&, const Eigen::Matrix<double, 5, 1>&) noexcept;
template Eigen::Matrix<double, 6, 1> solve_symmetric<6>(
    const Eigen::Matrix<double, 6, 6>&, const Eigen::Matrix<double, 6, 1>&) noexcept;

Eigen::VectorXd least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
  return a.colPivHouseholderQr().solve(b);
}

}  // namespace palpate
