// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/tool/least_motion.hpp"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <limits>

namespace palpate {
namespace {

constexpr int most_steps = 40;      // each takes a limit in or drops one; contacts need some ten
constexpr double met = 1e-9;        // [m] a limit violated by less is met
constexpr double dependent = 1e-9;  // [-] of a direction's square that is new: less is nothing

using Six = std::array<double, 6>;

// In one order on every processor.
double dot(const Motion6& a, const Motion6& b) noexcept {
  double sum = a[0] * b[0];
  for (int i = 1; i < 6; ++i) sum += a[i] * b[i];
  return sum;
}

// Solves (N' N) r = N' d for the directions of the limits that hold, by Cholesky's method.
Six shares(std::span<const MotionLimit> limits, const HeldBy& held, const Motion6& d) noexcept {
  std::array<Six, 6> l{};
  Six r{};
  for (std::size_t i = 0; i < held.count; ++i) {
    const Motion6& row = limits[held.limit[i]].direction;
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = dot(row, limits[held.limit[j]].direction);
      for (std::size_t k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
      l[i][j] = i == j ? std::sqrt(std::max(sum, dependent)) : sum / l[j][j];
    }
    r[i] = dot(row, d);
    for (std::size_t k = 0; k < i; ++k) r[i] -= l[i][k] * r[k];
    r[i] /= l[i][i];
  }
  for (std::size_t i = held.count; i-- > 0;) {
    for (std::size_t k = i + 1; k < held.count; ++k) r[i] -= l[k][i] * r[k];
    r[i] /= l[i][i];
  }
  return r;
}

void drop(HeldBy& held, std::size_t i) noexcept {
  for (; i + 1 < held.count; ++i) {
    held.limit[i] = held.limit[i + 1];
    held.push[i] = held.push[i + 1];
  }
  --held.count;
}

}  // namespace

HeldBy least_motion(std::span<const MotionLimit> limits, Motion6& motion) noexcept {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  limits = limits.first(std::min(limits.size(), most_motion_limits));
  HeldBy held;
  std::bitset<most_motion_limits> contradicts;
  for (int step = 0; step < most_steps;) {
    std::size_t worst = limits.size();
    double slack = -met;
    for (std::size_t i = 0; i < limits.size(); ++i) {
      const double here = dot(limits[i].direction, motion) - limits[i].least;
      if (here < slack && !contradicts[i]) {
        slack = here;
        worst = i;
      }
    }
    if (worst == limits.size()) {
      held.all_met = contradicts.none();
      return held;
    }
    const Motion6& d = limits[worst].direction;
    double push = 0.0;
    for (bool taken = false; !taken && step < most_steps; ++step) {
      const Six r = shares(limits, held, d);
      Motion6 z = d;
      for (std::size_t i = 0; i < held.count; ++i) z -= r[i] * limits[held.limit[i]].direction;
      // How far until a limit that holds pushes no more, and until this one is met.
      std::size_t leaves = held.count;
      double until = infinite;
      for (std::size_t i = 0; i < held.count; ++i) {
        if (r[i] > 1e-12 && held.push[i] / r[i] < until) {
          until = held.push[i] / r[i];
          leaves = i;
        }
      }
      const double fresh = dot(z, d);
      const bool moves = held.count < 6 && fresh > dependent * dot(d, d);
      const double full = moves ? (limits[worst].least - dot(d, motion)) / fresh : infinite;
      const double length = std::min(until, full);
      if (length == infinite) {
        contradicts.set(worst);
        break;
      }
      for (std::size_t i = 0; i < held.count; ++i) held.push[i] -= length * r[i];
      push += length;
      if (moves) motion += length * z;
      if (length == full) {
        held.limit[held.count] = worst;
        held.push[held.count++] = push;
        taken = true;
      } else {
        drop(held, leaves);
      }
    }
  }
  held.all_met = false;
  return held;
}

}  // namespace palpate
