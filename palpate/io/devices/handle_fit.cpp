// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "palpate/io/devices/device_probe.hpp"
#include "palpate/kernel/core/linear.hpp"

namespace palpate {
namespace {

constexpr double least_way = 2e-3;     // [m] of a swing: 36 counts of a Touch
constexpr double sideways = 0.2;       // [-] of that, along other axes: friction acts along the way
constexpr double longest_swing = 0.8;  // [s] of a swing
constexpr double trimmed = 0.02;       // [-] of its way, at both ends: where it rests, and turns
constexpr double turn = 0.5e-3;        // [m] back that end a swing
constexpr std::size_t fewest = 16;     // samples of a swing
constexpr std::size_t fewest_swings = 4;  // of an axis
constexpr double longest_delay = 10e-3;
constexpr double delay_step = 0.1e-3;  // [s]
// [-] The equations of a swing overlap, so that each says less than it seems.
constexpr double overlap = 2.0;

// (s (1 - s))^2 times a power of 2 s - 1, over a swing, s from 0 to 1: with its derivative it is
// zero at both ends. Coefficients from s^0 on.
constexpr std::size_t weight_count = 5;
constexpr int degree = 8;
using Polynomial = std::array<double, degree + 2>;

constexpr Polynomial times(const Polynomial& a, const Polynomial& b) {
  Polynomial product{};
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; i + j < product.size(); ++j) product[i + j] += a[i] * b[j];
  }
  return product;
}
constexpr Polynomial integral(const Polynomial& p) {
  Polynomial sum{};
  for (std::size_t i = 1; i < p.size(); ++i) sum[i] = p[i - 1] / static_cast<double>(i);
  return sum;
}
double at(const Polynomial& p, double s) {
  double value = 0.0;
  for (std::size_t i = p.size(); i-- > 0;) value = value * s + p[i];
  return value;
}

struct Weight {
  Polynomial value, sum;
};

const std::array<Weight, weight_count>& weights() {
  static const auto all = [] {
    constexpr Polynomial bump{0.0, 1.0, -1.0};
    constexpr Polynomial odd{-1.0, 2.0};
    std::array<Weight, weight_count> made;
    Polynomial p = times(bump, bump);
    for (Weight& weight : made) {
      weight = {p, integral(p)};
      p = times(p, odd);
    }
    return made;
  }();
  return all;
}

// One way along an axis: samples first to last.
struct Swing {
  std::size_t first, last;
  double sign;  // of the velocity
};

// Does it come to rest on its way? Then friction holds it for a while, and does not brake.
bool pauses(std::span<const HandleSample> samples, int axis, const Swing& swing) {
  constexpr double window = 10e-3;  // [s]
  constexpr double slowest = 0.2;   // [-] of its mean speed, but for a tenth of the way at each end
  const HandleSample& first = samples[swing.first];
  const HandleSample& last = samples[swing.last];
  const double way = last.position[axis] - first.position[axis];
  const double least = slowest * window * way / (last.t - first.t);
  std::size_t behind = swing.first;
  for (std::size_t i = swing.first; i <= swing.last; ++i) {
    while (samples[i].t - samples[behind].t > window) ++behind;
    const double from = (samples[behind].position[axis] - first.position[axis]) / way;
    const double to = (samples[i].position[axis] - first.position[axis]) / way;
    const double moved = samples[i].position[axis] - samples[behind].position[axis];
    if (from > 0.1 && to < 0.9 && moved * swing.sign < least * swing.sign) return true;
    // At its ends it is slow, but does not rest.
    constexpr double rests = 0.003;  // [-] of the way
    if (samples[i].t - first.t > window && moved / way < rests) return true;
  }
  return false;
}

// Where the handle turned, and the stretches between.
std::vector<Swing> swings_along(std::span<const HandleSample> samples, int axis) {
  std::vector<std::size_t> turns;
  std::size_t low = 0;
  std::size_t high = 0;
  int direction = 0;  // of the stretch in progress
  const auto x = [&](std::size_t i) { return samples[i].position[axis]; };
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (x(i) > x(high)) high = i;
    if (x(i) < x(low)) low = i;
    if (direction >= 0 && x(i) < x(high) - turn) {
      turns.push_back(high);
      direction = -1;
      low = i;
    } else if (direction <= 0 && x(i) > x(low) + turn) {
      turns.push_back(low);
      direction = 1;
      high = i;
    }
    if (direction > 0) low = i;
    if (direction < 0) high = i;
    if (direction > 0 && x(i) >= x(high)) high = i;
    if (direction < 0 && x(i) <= x(low)) low = i;
  }
  std::vector<Swing> swings;
  for (std::size_t k = 1; k < turns.size(); ++k) {
    const std::size_t from = turns[k - 1];
    const std::size_t to = turns[k];
    const double way = x(to) - x(from);
    if (std::abs(way) < least_way) continue;
    Swing swing{from, to, way > 0.0 ? 1.0 : -1.0};
    const auto gone = [&](std::size_t i) { return (x(i) - x(from)) / way; };
    while (swing.first < to && gone(swing.first + 1) < trimmed) ++swing.first;
    while (swing.last > swing.first && gone(swing.last) > 1.0 - trimmed) --swing.last;
    const Vec3 moved = samples[swing.last].position - samples[swing.first].position;
    Vec3 aside = moved;
    aside[axis] = 0.0;
    if (swing.last < swing.first + fewest || aside.norm() > sideways * std::abs(way) ||
        samples[swing.last].t - samples[swing.first].t > longest_swing)
      continue;
    if (!pauses(samples, axis, swing)) swings.push_back(swing);
  }
  return swings;
}

// The model divided by the mass, in integrals: the place's, on the left, has the noise.
//   x'' = (F - f sign(x') - b x' + g - k x) / m: left = columns * (1, f, b, g, k) / m
constexpr int unknowns = 5;
struct Equations {
  int axis = 0;
  std::vector<Swing> swings;
  Eigen::VectorXd left;
  Eigen::Matrix<double, Eigen::Dynamic, unknowns> columns;  // the first, the force's, by the delay
};

Equations equations_of(std::span<const HandleSample> samples, int axis, std::vector<Swing> swings) {
  Equations equations{axis, std::move(swings), {}, {}};
  const auto rows = static_cast<Eigen::Index>(weight_count * equations.swings.size());
  equations.left.resize(rows);
  equations.columns.resize(rows, unknowns);
  Eigen::Index row = 0;
  for (const Swing& swing : equations.swings) {
    const double begin = samples[swing.first].t;
    const double length = samples[swing.last].t - begin;
    for (const Weight& weight : weights()) {
      double accelerated = 0.0;
      double moved = 0.0;
      double placed = 0.0;
      const double origin = samples.front().position[axis];
      for (std::size_t i = swing.first; i < swing.last; ++i) {
        // Exact for places that lie on straight lines between the samples: by parts, from speeds.
        const double s = (samples[i].t - begin) / length;
        const double next = (samples[i + 1].t - begin) / length;
        if (!(next > s)) continue;
        const double x = samples[i].position[axis] - origin;
        const double next_x = samples[i + 1].position[axis] - origin;
        const double speed = (next_x - x) / ((next - s) * length);
        accelerated -= speed * (at(weight.value, next) - at(weight.value, s));
        const double share = at(weight.sum, next) - at(weight.sum, s);
        moved -= speed * share * length;
        placed += 0.5 * (x + next_x) * share * length;
      }
      const double area = length * at(weight.sum, 1.0);
      equations.left[row] = accelerated;
      equations.columns.row(row++) << 0.0, -swing.sign * area, moved, area, -placed;
    }
  }
  return equations;
}

// The integrals of the force, held from each write to the next, as it acts `delay` later.
Eigen::VectorXd forces_of(std::span<const HandleSample> samples, const Equations& equations,
                          double delay) {
  Eigen::VectorXd forces(equations.left.size());
  Eigen::Index row = 0;
  for (const Swing& swing : equations.swings) {
    const double begin = samples[swing.first].t;
    const double length = samples[swing.last].t - begin;
    const auto s_of = [&](double t) { return std::clamp((t + delay - begin) / length, 0.0, 1.0); };
    std::size_t from = swing.first;
    while (from > 0 && samples[from].t + delay > begin) --from;
    for (const Weight& weight : weights()) {
      double total = 0.0;
      double last = at(weight.sum, s_of(samples[from].t));
      for (std::size_t i = from; i < swing.last; ++i) {
        const double next = at(weight.sum, s_of(samples[i + 1].t));
        total += samples[i].force[equations.axis] * (next - last);
        last = next;
      }
      forces[row++] = length * total;
    }
  }
  return forces;
}

// Least squares over the first `count` unknowns.
struct Solution {
  Eigen::VectorXd values;
  Eigen::MatrixXd covariance;
  double left = 0.0;   // sum of squares
  double share = 0.0;  // of what was to be explained, rms

  // Mass, or another unknown times the mass.
  [[nodiscard]] Measured mass() const {
    const double m = 1.0 / values[0];
    return {m, 2.0 * m * m * std::sqrt(std::max(covariance(0, 0), 0.0))};
  }
  [[nodiscard]] Measured times_mass(Eigen::Index i) const {
    const double value = values[i] / values[0];
    const double variance =
        covariance(i, i) - 2.0 * value * covariance(i, 0) + value * value * covariance(0, 0);
    return {value, 2.0 * std::sqrt(std::max(variance, 0.0)) / std::abs(values[0])};
  }
};

Solution solve(const Equations& equations, const Eigen::VectorXd& forces, Eigen::Index count) {
  Eigen::MatrixXd a = equations.columns.leftCols(count);
  a.col(0) = forces;
  const Eigen::VectorXd scale = a.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  a = a * scale.asDiagonal();
  const Eigen::VectorXd scaled = least_squares(a, equations.left);
  Solution solution;
  solution.left = (equations.left - a * scaled).squaredNorm();
  solution.share = std::sqrt(solution.left / std::max(equations.left.squaredNorm(), 1e-300));
  solution.values = scale.cwiseProduct(scaled);
  const auto spare = static_cast<double>(std::max<Eigen::Index>(a.rows() - count, 1));
  const Eigen::MatrixXd inverse =
      (a.transpose() * a).ldlt().solve(Eigen::MatrixXd::Identity(count, count));
  solution.covariance =
      overlap * solution.left / spare * (scale.asDiagonal() * inverse * scale.asDiagonal());
  return solution;
}

// [s] What leaves the least over; the axes weighted by how well each fits at its best.
Measured delay_of(std::span<const HandleSample> samples, const std::vector<Equations>& all) {
  const int count = static_cast<int>(std::lround(longest_delay / delay_step)) + 1;
  std::vector<double> left(static_cast<std::size_t>(count), 0.0);
  for (const Equations& equations : all) {
    std::vector<double> of_axis;
    for (int i = 0; i < count; ++i)
      of_axis.push_back(solve(equations, forces_of(samples, equations, i * delay_step), 4).left);
    const double least = std::max(*std::min_element(of_axis.begin(), of_axis.end()), 1e-30);
    const auto free = static_cast<double>(equations.left.size() - 4);
    for (std::size_t i = 0; i < left.size(); ++i) left[i] += free * of_axis[i] / least;
  }
  const auto best = static_cast<std::size_t>(
      std::distance(left.begin(), std::min_element(left.begin(), left.end())));
  const double delay = static_cast<double>(best) * delay_step;
  if (best == 0) return {0.0, 2.0 * delay_step};
  if (best + 1 == left.size()) return {longest_delay, longest_delay};
  // A parabola through the three lowest; `left` grows by `overlap` within a standard deviation.
  const double bend = left[best - 1] - 2.0 * left[best] + left[best + 1];
  return {delay + 0.5 * delay_step * (left[best - 1] - left[best + 1]) / bend,
          2.0 * delay_step * std::sqrt(2.0 * overlap / bend)};
}

// Drops swings that fit far worse than most: somebody touched the handle, or it paused. True if any
// was dropped.
bool drop_outliers(std::span<const HandleSample> samples, double delay, Equations& equations) {
  constexpr double far_worse = 6.0;  // [-] times the median of the squares
  const Eigen::VectorXd forces = forces_of(samples, equations, delay);
  Eigen::MatrixXd a = equations.columns.leftCols(4);
  a.col(0) = forces;
  const Eigen::VectorXd rest = equations.left - a * solve(equations, forces, 4).values;
  const auto rows = static_cast<Eigen::Index>(weight_count);
  std::vector<double> squares;
  for (Eigen::Index i = 0; i < rest.size(); i += rows)
    squares.push_back(rest.segment(i, rows).squaredNorm());
  std::vector<double> sorted = squares;
  std::sort(sorted.begin(), sorted.end());
  const double most = far_worse * sorted[sorted.size() / 2];
  std::vector<Swing> kept;
  for (std::size_t i = 0; i < squares.size(); ++i) {
    if (squares[i] <= most) kept.push_back(equations.swings[i]);
  }
  if (kept.size() == squares.size()) return false;
  equations = equations_of(samples, equations.axis, std::move(kept));
  return true;
}

}  // namespace

HandleFit fit_handle(std::span<const HandleSample> samples) {
  HandleFit fit;
  std::vector<Equations> all;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<Swing> swings = swings_along(samples, axis);
    if (swings.size() >= fewest_swings)
      all.push_back(equations_of(samples, axis, std::move(swings)));
  }
  if (all.empty()) return fit;

  constexpr int rounds = 3;
  Measured delay = delay_of(samples, all);
  for (int round = 1; round < rounds; ++round) {
    bool dropped = false;
    for (Equations& equations : all)
      dropped = drop_outliers(samples, delay.value, equations) || dropped;
    if (!dropped) break;
    delay = delay_of(samples, all);
  }
  fit.delay = delay;
  for (const Equations& equations : all) {
    const Eigen::VectorXd forces = forces_of(samples, equations, delay.value);
    const Solution four = solve(equations, forces, 4);
    const Solution five = solve(equations, forces, 5);
    fit.axes[static_cast<std::size_t>(equations.axis)] =
        AxisFit{.mass = four.mass(),
                .damping = four.times_mass(2),
                .friction = four.times_mass(1),
                .load = four.times_mass(3),
                .spring = five.times_mass(4),
                .swings = static_cast<int>(equations.swings.size()),
                .misfit = four.share};
  }
  return fit;
}

}  // namespace palpate
