// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/linear.hpp"

#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

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

Axes6 axes_of_six(Eigen::Matrix<double, 6, 6> symmetric) noexcept {
  constexpr int n = 6;
  constexpr int most_sweeps = 50;  // some 8 are needed
  Axes6 axes{symmetric.diagonal(), Eigen::Matrix<double, n, n>::Identity()};
  bool turned = true;
  for (int sweep = 0; turned && sweep < most_sweeps; ++sweep) {
    turned = false;
    for (int p = 0; p < n; ++p) {
      for (int q = p + 1; q < n; ++q) {
        const double beside = symmetric(p, q);
        const double p_value = symmetric(p, p);
        const double q_value = symmetric(q, q);
        if (!(std::abs(beside) > 1e-16 * std::sqrt(std::abs(p_value * q_value)))) continue;
        turned = true;
        const double slope = (q_value - p_value) / (2.0 * beside);
        const double tangent =
            (slope < 0.0 ? -1.0 : 1.0) / (std::abs(slope) + std::sqrt(1.0 + slope * slope));
        const double cosine = 1.0 / std::sqrt(1.0 + tangent * tangent);
        const double sine = tangent * cosine;
        const auto turn = [&](double& x, double& y) {
          const double before = x;
          x = cosine * x - sine * y;
          y = sine * before + cosine * y;
        };
        for (int i = 0; i < n; ++i) turn(symmetric(i, p), symmetric(i, q));
        for (int i = 0; i < n; ++i) turn(symmetric(p, i), symmetric(q, i));
        for (int i = 0; i < n; ++i) turn(axes.vectors(i, p), axes.vectors(i, q));
      }
    }
  }
  for (int i = 0; i < n; ++i) axes.values[i] = symmetric(i, i);
  for (int i = 0; i < n; ++i) {
    int least = i;
    for (int j = i + 1; j < n; ++j)
      if (axes.values[j] < axes.values[least]) least = j;
    std::swap(axes.values[i], axes.values[least]);
    for (int k = 0; k < n; ++k) std::swap(axes.vectors(k, i), axes.vectors(k, least));
  }
  return axes;
}

// Gram and Schmidt's, modified, with b as one more column.
Eigen::VectorXd least_squares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& right) {
  Eigen::MatrixXd a = columns;
  Eigen::VectorXd b = right;
  const Eigen::Index rows = a.rows();
  const Eigen::Index n = a.cols();
  const auto along = [&](Eigen::Index j, const double* column) {
    double sum = 0.0;
    for (Eigen::Index i = 0; i < rows; ++i) sum += a(i, j) * column[i];
    return sum;
  };
  Eigen::MatrixXd r(n, n);
  Eigen::VectorXd x(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double before = std::sqrt(along(j, &a(0, j)));
    const auto take = [&](Eigen::Index k, double* column) {
      const double part = along(k, column);
      for (Eigen::Index i = 0; i < rows; ++i) column[i] -= part * a(i, k);
      return part;
    };
    for (Eigen::Index k = 0; k < j; ++k) r(k, j) = take(k, &a(0, j));
    const double length = std::sqrt(along(j, &a(0, j)));
    r(j, j) =
        length > 1e-14 * before ? length : 0.0;  // a column that the others make up is left out
    for (Eigen::Index i = 0; i < rows; ++i) a(i, j) = r(j, j) > 0.0 ? a(i, j) / length : 0.0;
    x[j] = take(j, b.data());
  }
  for (Eigen::Index j = n; j-- > 0;) {
    for (Eigen::Index k = j + 1; k < n; ++k) x[j] -= r(j, k) * x[k];
    x[j] = r(j, j) > 0.0 ? x[j] / r(j, j) : 0.0;
  }
  return x;
}

}  // namespace palpate
