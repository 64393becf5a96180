// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/fit_test.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/kernel/core/linear.hpp"

namespace palpate {
namespace {

// Residuals this small are no structure, whatever the noise [m].
constexpr double structure_floor = 50e-6;
// Noise leaves single cells empty, an edge leaves a whole row.
constexpr int most_empty = 2;
constexpr double least_shared = 6.0;  // cells of two frames, from which noise is learned
constexpr double most_samples = 30.0;

// The middle of a cell, from the corner of the first one [cells].
Vec2 place_in_square(std::size_t k) {
  constexpr std::size_t side = 4;
  return {static_cast<double>(k % side) + 0.5, static_cast<double>(k / side) + 0.5};
}

}  // namespace

void FitTest::forget() noexcept {
  for (Frame& each : frames_) each.full = false;
}

void FitTest::move_origin(const Eigen::Vector2i& step, double up) noexcept {
  for (Frame& each : frames_) {
    each.first -= step;
    for (double& height : each.heights) height -= up;
  }
}

void FitTest::take(const LocalPoints& points, const Quadric& surface, const Look& look) noexcept {
  if (look.new_frame) newest_ = (newest_ + 1) % most_frames;
  Frame& now = frames_[newest_];
  const Vec2 corner = look.foot / look.cell - Vec2::Constant(0.5 * side);
  now.first = corner.array().round().cast<int>();
  now.heights.fill(0.0);
  std::array<double, cells> counts{};
  const FloatQuadric expected(surface);
  const auto first_u = static_cast<float>(now.first.x());
  const auto first_v = static_cast<float>(now.first.y());
  const auto per_cell = static_cast<float>(1.0 / look.cell);
  const auto gate = static_cast<float>(look.gate);
  for (std::size_t i = 0; i < points.size; ++i) {
    const float u = points.x[i] * per_cell - first_u;
    const float v = points.y[i] * per_cell - first_v;
    if (!(u >= 0.0F && v >= 0.0F && u < side && v < side)) continue;
    const float residual = points.z[i] - expected.height(points.x[i], points.y[i]);
    if (!(std::abs(residual) <= gate)) continue;
    const auto k = static_cast<std::size_t>(static_cast<int>(v) * side + static_cast<int>(u));
    now.heights[k] += double{residual};
    counts[k] += 1.0;
  }
  int empty = 0;
  for (std::size_t k = 0; k < cells; ++k) {
    now.has_points[k] = counts[k] > 0.0;
    empty += now.has_points[k] ? 0 : 1;
    const Vec2 middle = now.first.cast<double>() + place_in_square(k);
    now.heights[k] = now.heights[k] / std::max(counts[k], 1.0) + surface.height(look.cell * middle);
  }
  now.full = look.is_whole && empty <= most_empty;
}

// Noise of a cell, from the differences of two frames in the cells that both measured, less their
// common part.
void FitTest::learn_noise(const Frame& newest, const Frame& past) noexcept {
  const Eigen::Vector2i offset = newest.first - past.first;
  double sum = 0.0;
  double squares = 0.0;
  double shared = 0.0;
  for (int v = std::max(0, -offset.y()); v < side - std::max(0, offset.y()); ++v) {
    for (int u = std::max(0, -offset.x()); u < side - std::max(0, offset.x()); ++u) {
      const auto k = static_cast<std::size_t>(v * side + u);
      const auto past_k = static_cast<std::size_t>((v + offset.y()) * side + u + offset.x());
      if (!newest.has_points[k] || !past.has_points[past_k]) continue;
      const double change = newest.heights[k] - past.heights[past_k];
      sum += change;
      squares += change * change;
      shared += 1.0;
    }
  }
  if (shared < least_shared) return;
  const double change = std::max(squares - sum * sum / shared, 0.0) / (2.0 * (shared - 1.0));
  samples_ = std::min(samples_ + 1.0, most_samples);
  variance_ += (change - variance_) / samples_;
}

bool FitTest::judge(bool so_far) noexcept {
  const Frame& newest = frames_[newest_];
  if (!newest.full) return false;
  std::array<double, cells> heights = newest.heights;
  std::size_t frames = 1;
  for (; frames < most_frames; ++frames) {
    const Frame& past = frames_[(newest_ + most_frames - frames) % most_frames];
    if (!past.full) break;
    if (frames == 1) learn_noise(newest, past);
    if (past.first != newest.first) break;
    for (std::size_t k = 0; k < cells; ++k) heights[k] += past.heights[k];
  }
  // Mean square about the cells' own best quadric: errors of the fit, which grow towards the
  // corners, do not count as structure.
  const auto basis = [](std::size_t k) {
    return quadric_basis(place_in_square(k) - Vec2::Constant(0.5 * side));
  };
  Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Zero();
  Vec6 b = Vec6::Zero();
  for (std::size_t k = 0; k < cells; ++k) {
    if (!newest.has_points[k]) continue;
    a.noalias() += basis(k) * basis(k).transpose();
    b += heights[k] * basis(k);
  }
  const Vec6 own = solve_symmetric<6>(a, b);
  double squares = 0.0;
  double freedom = -6.0;
  for (std::size_t k = 0; k < cells; ++k) {
    if (!newest.has_points[k]) continue;
    const double off = heights[k] - own.dot(basis(k));
    squares += off * off;
    freedom += 1.0;
  }
  const auto n = static_cast<double>(frames);
  const double structure = squares / (freedom * n * n);
  // Structure below the noise of one frame is ignored: over points the proxy would not rest better.
  const double times = std::max((so_far ? 6.0 : 3.0) / n, so_far ? 2.0 : 1.0);
  return structure <= structure_floor * structure_floor + times * variance_;
}

}  // namespace palpate
