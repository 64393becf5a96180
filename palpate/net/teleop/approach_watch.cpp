// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/teleop/approach_watch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

namespace palpate {
namespace {

struct Distance {
  double t;         // [s] 0 is now
  double distance;  // [m]
};

struct Line {
  double slope;     // [m/s]
  double now;       // [m] at t = 0
  double variance;  // [m^2] of what it leaves over
  double spread;    // [s^2] sum of the squares of times about their mean
};

// By least squares.
Line line_through(std::span<const Distance> points) {
  const auto n = static_cast<double>(points.size());
  double mean_t = 0.0;
  double mean_d = 0.0;
  for (const auto& [t, distance] : points) {
    mean_t += t / n;
    mean_d += distance / n;
  }
  Line line{};
  double covariance = 0.0;
  for (const auto& [t, distance] : points) {
    line.spread += (t - mean_t) * (t - mean_t);
    covariance += (t - mean_t) * (distance - mean_d);
  }
  line.slope = covariance / line.spread;
  line.now = mean_d - line.slope * mean_t;
  for (const auto& [t, distance] : points) {
    const double left = distance - line.now - line.slope * t;
    line.variance += left * left / (n - 2.0);
  }
  return line;
}

}  // namespace

ApproachWatch::ApproachWatch() : patch_(std::make_unique<Patch>()) {}

// Where the nearest points are; false where there are too few.
bool ApproachWatch::find_nearest(const Cloud& cloud, const Vec3& tool, Vec3& towards) {
  gather(cloud, Ball{tool, reach}, *patch_);
  const std::size_t count = patch_->size();
  if (count < nearest) return false;
  const PointArrays points = patch_->points();
  squares_.resize(count);
  order_.resize(count);
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  for (std::size_t i = 0; i < count; ++i)
    squares_[i] = points.x[i] * points.x[i] + points.y[i] * points.y[i] + points.z[i] * points.z[i];
  const auto end = order_.begin() + static_cast<std::ptrdiff_t>(nearest);
  std::nth_element(order_.begin(), end - 1, order_.end(),
                   [this](std::size_t a, std::size_t b) { return squares_[a] < squares_[b]; });
  towards.setZero();
  for (auto it = order_.begin(); it != end; ++it)
    towards += Vec3(points.x[*it], points.y[*it], points.z[*it]) / nearest;
  return towards.norm() > 0.0;
}

// The mean distance of what lies in a direction, as far as it is one surface; NaN if nothing does.
double ApproachWatch::distance_along(const Cloud& cloud, const Vec3& tool, const Vec3& direction,
                                     double expected) {
  gather(cloud, Ball{tool, reach}, *patch_);
  const PointArrays points = patch_->points();
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < patch_->size(); ++i) {
    const Vec3 p(points.x[i], points.y[i], points.z[i]);
    const double along = p.dot(direction);
    if (std::abs(along - expected) > one_surface ||
        p.squaredNorm() - along * along > across * across)
      continue;
    sum += along;
    ++count;
  }
  return count < nearest ? std::numeric_limits<double>::quiet_NaN()
                         : sum / static_cast<double>(count);
}

// How far a place is behind all that is seen in its direction [m]; negative before it, and where
// nothing is seen.
double ApproachWatch::behind(const Cloud& cloud, const Vec3& place, double radius) noexcept {
  constexpr double far = 0.3;  // [m]
  gather(cloud, Beam{place, radius, far, Vec3::UnitZ()}, Patch::capacity, *patch_);
  double least = patch_->size() > 0 ? far : -far;
  for (std::size_t view = 0; view < patch_->view_count(); ++view) {
    const std::optional<Vec3>& viewpoint = patch_->view(view).viewpoint;
    if (!viewpoint) return -far;  // where it is seen from is not known
    const Vec3 sight = (place - *viewpoint).normalized();
    for (std::size_t i = patch_->view(view).begin; i < patch_->view_end(view); ++i)
      least = std::min(least, -sight.dot(Vec3(patch_->x()[i], patch_->y()[i], patch_->z()[i])));
  }
  return least;
}

bool ApproachWatch::is_between(const Vec3& proxy, const Vec3& tool, double radius,
                               double t) noexcept {
  constexpr double interval = 0.01;  // [s]
  constexpr int most = 16;           // places that are looked at
  if (seen_.empty()) return false;
  if (t >= looked_ && t - looked_ < interval) return between_;
  looked_ = t;
  between_ = false;
  const Cloud& cloud = *seen_.back().cloud;
  const Vec3 way = proxy - tool;
  const int count = std::clamp(static_cast<int>(std::ceil(way.norm() / radius)), 1, most);
  // A way through a surface is just before it at one place and just behind it at the next; what
  // only hides the way is far before it. A tool that is in something already is led out of it.
  double last = behind(cloud, tool, radius);
  for (int i = 1; i <= count && !between_; ++i) {
    const double depth = behind(cloud, tool + static_cast<double>(i) / count * way, radius);
    between_ = last > -2.0 * radius && last <= radius && depth > radius && depth < 4.0 * radius;
    last = depth;
  }
  return between_;
}

const Approach& ApproachWatch::frame(std::shared_ptr<const Cloud> cloud, double stamp,
                                     const Vec3& tool) {
  approach_ = Approach{.place = tool, .stamp = stamp, .noise = approach_.noise};
  const bool came = std::exchange(comes_, false);
  if (!seen_.empty() && !(stamp > seen_.back().stamp)) seen_.clear();
  if (seen_.size() == frames) seen_.erase(seen_.begin());
  seen_.push_back({std::move(cloud), stamp});
  clearance_ = reach;
  Vec3 towards = Vec3::Zero();
  if (!find_nearest(*seen_.back().cloud, tool, towards)) return approach_;
  const double size = towards.norm();
  clearance_ = size;
  towards /= size;
  std::array<Distance, frames> distances{};
  std::size_t count = 0;
  double expected = size;
  while (count < seen_.size()) {
    const Seen& seen = seen_[seen_.size() - 1 - count];
    expected = distance_along(*seen.cloud, tool, towards, expected);
    if (std::isnan(expected)) break;
    distances[count++] = {seen.stamp - stamp, expected};
  }
  if (count < windows.front()) return approach_;

  Line best{};
  double most = -1.0;  // how sure it is that something comes
  for (const std::size_t window : windows) {
    if (window > count) break;
    const Line line = line_through({distances.data(), window});
    // A few frames say little of their own noise; the last second says more.
    if (window == windows.front())
      variance_ =
          variance_ < 0.0 ? line.variance : variance_ + (line.variance - variance_) / noise_memory;
    approach_.noise = std::sqrt(variance_);
    const double error = std::sqrt(std::max(variance_, line.variance / surprise) / line.spread);
    const double sure = error > 0.0 ? -line.slope / error : -line.slope / 1e-9;
    if (sure > most) {
      most = sure;
      best = line;
    }
  }
  const double enough = came ? 0.5 : 1.0;
  if (!(-best.slope > enough * least_speed && most > enough * least_ratio)) return approach_;
  comes_ = true;
  approach_.speed = -best.slope;
  approach_.gap = std::max(best.now, 0.0);
  approach_.away = -towards;
  return approach_;
}

}  // namespace palpate
