// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/fit_test.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/kernel/core/linear.hpp"

namespace palpate {
namespace {

// Residuals this small are no structure, whatever the noise [detail].
constexpr double structure_floor = 0.01;

}  // namespace

void FitTest::look(const LocalPoints& points, const Quadric& surface, const Vec2& foot, double gate,
                   bool partial, bool new_frame) noexcept {
  if (new_frame) newest_ = (newest_ + 1) % frames_looked_at;
  Cells& now = cells_[newest_];
  const Vec2 corner = foot / cell_size_ - Vec2::Constant(0.5 * cells_per_side);
  now.first = corner.array().round().cast<int>();
  now.heights.fill(0.0);
  now.means.fill(Vec6::Zero());
  const FloatQuadric expected(surface);
  const auto first_u = static_cast<float>(now.first.x());
  const auto first_v = static_cast<float>(now.first.y());
  const auto per_cell = static_cast<float>(1.0 / cell_size_);
  const auto farthest = static_cast<float>(gate);
  for (std::size_t i = 0; i < points.size; ++i) {
    const float x = points.x[i];
    const float y = points.y[i];
    const float z = points.z[i];
    const float u = x * per_cell - first_u;
    const float v = y * per_cell - first_v;
    if (!(u >= 0.0F && v >= 0.0F && u < cells_per_side && v < cells_per_side)) continue;
    if (!(std::abs(z - expected.height(x, y)) <= farthest)) continue;
    const auto k =
        static_cast<std::size_t>(static_cast<int>(v) * cells_per_side + static_cast<int>(u));
    now.heights[k] += double{z};
    now.means[k] += quadric_basis(Vec2(x, y));
  }
  // Noise leaves single cells empty, an edge leaves a whole row.
  constexpr int most_empty = 2;
  int empty = 0;
  for (std::size_t k = 0; k < cells; ++k) {
    const double count = now.means[k][0];
    if (!(count > 0.0)) {
      ++empty;
      continue;
    }
    now.heights[k] /= count;
    now.means[k] /= count;
  }
  now.full = !partial && empty <= most_empty;
}

bool FitTest::describes(const Quadric& surface, double detail, bool stays) noexcept {
  const Cells& newest = cells_[newest_];
  if (!newest.full) return false;
  const Residuals residuals = residuals_of(newest, surface);
  Residuals sums = residuals;
  std::size_t frames = 1;
  for (; frames < frames_looked_at; ++frames) {
    const Cells& past = cells_[(newest_ + frames_looked_at - frames) % frames_looked_at];
    if (!past.full) break;
    const Residuals older = residuals_of(past, surface);
    if (frames == 1) learn_noise(newest, residuals, past, older);
    if (past.first != newest.first) break;
    for (std::size_t k = 0; k < cells; ++k) sums[k] += older[k];
  }
  const auto n = static_cast<double>(frames);
  const double structure = squared_structure(newest, sums, detail) / squared(n);
  // Structure below the noise of one frame is ignored: over points the proxy would not rest better.
  const double times = std::max((stays ? 6.0 : 3.0) / n, stays ? 2.0 : 1.0);
  return structure <= squared(structure_floor * detail) + times * variance_;
}

// Residuals over the surface as it is known now, less what all cells share; 0 of empty ones.
FitTest::Residuals FitTest::residuals_of(const Cells& frame, const Quadric& surface) noexcept {
  Residuals residuals;
  double sum = 0.0;
  double present = 0.0;
  for (std::size_t k = 0; k < cells; ++k) {
    residuals[k] = frame.heights[k] - surface.c.dot(frame.means[k]);
    sum += residuals[k];
    present += frame.means[k][0];
  }
  for (std::size_t k = 0; k < cells; ++k) residuals[k] -= frame.means[k][0] * sum / present;
  return residuals;
}

// Mean square of the cells' residuals about their own best quadric [m^2]: errors of the fit, which
// grow towards the corners, do not count as structure.
double FitTest::squared_structure(const Cells& frame, const Residuals& residuals,
                                  double detail) noexcept {
  const double unit = 2.0 * detail;  // [m] about half of what the cells span
  Eigen::Matrix<double, 6, 6> a = 1e-9 * Eigen::Matrix<double, 6, 6>::Identity();
  Vec6 b = Vec6::Zero();
  std::array<Vec6, cells> basis;
  for (std::size_t k = 0; k < cells; ++k) {
    Vec6& means = basis[k];
    means = frame.means[k];
    means.segment<2>(1) *= 1.0 / unit;
    means.tail<3>() *= 1.0 / squared(unit);
    a.noalias() += means * means.transpose();
    b += residuals[k] * means;
  }
  const Vec6 c = solve_symmetric<6>(a, b);
  double sum = 0.0;
  double present = 0.0;
  for (std::size_t k = 0; k < cells; ++k) {
    sum += squared(residuals[k] - c.dot(basis[k]));
    present += frame.means[k][0];
  }
  return sum / (present - 6.0);
}

// Noise of a cell, from the differences of two frames in the cells that both measured, less their
// common part.
void FitTest::learn_noise(const Cells& newest, const Residuals& residuals, const Cells& past,
                          const Residuals& older) noexcept {
  const Eigen::Vector2i offset = newest.first - past.first;
  double sum = 0.0;
  double squares = 0.0;
  double shared = 0.0;
  for (int v = 0; v < cells_per_side; ++v) {
    for (int u = 0; u < cells_per_side; ++u) {
      const int past_u = u + offset.x();
      const int past_v = v + offset.y();
      if (past_u < 0 || past_v < 0 || past_u >= cells_per_side || past_v >= cells_per_side)
        continue;
      const auto k = static_cast<std::size_t>(v * cells_per_side + u);
      const auto past_k = static_cast<std::size_t>(past_v * cells_per_side + past_u);
      if (newest.means[k][0] == 0.0 || past.means[past_k][0] == 0.0) continue;
      const double change = residuals[k] - older[past_k];
      sum += change;
      squares += squared(change);
      shared += 1.0;
    }
  }
  constexpr double enough = 6.0;
  if (shared < enough) return;
  const double change = std::max(squares - sum * sum / shared, 0.0) / (2.0 * (shared - 1.0));
  samples_ = std::min(samples_ + 1.0, 30.0);
  variance_ += (change - variance_) / samples_;
}

void FitTest::move_origin(const Eigen::Vector2i& step, const Vec3& shift) noexcept {
  const Vec2 to = shift.head<2>();
  for (Cells& past : cells_) {
    past.first -= step;
    for (std::size_t k = 0; k < cells; ++k) {
      Vec6& m = past.means[k];
      if (m[0] == 0.0) continue;  // empty
      past.heights[k] -= shift.z();
      m[3] += to.x() * (to.x() - 2.0 * m[1]);
      m[4] += to.x() * to.y() - to.x() * m[2] - to.y() * m[1];
      m[5] += to.y() * (to.y() - 2.0 * m[2]);
      m.segment<2>(1) -= to;
    }
  }
}

}  // namespace palpate
