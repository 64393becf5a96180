// SPDX-License-Identifier: Apache-2.0
#include "palpate/teleop/approach_watch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace palpate {

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

const Approach& ApproachWatch::frame(std::shared_ptr<const Cloud> cloud, double stamp,
                                     const Vec3& tool) {
  approach_ = Approach{.place = tool, .stamp = stamp};
  const bool came = std::exchange(comes_, false);
  if (!seen_.empty() && !(stamp > seen_.back().stamp)) seen_.clear();
  if (seen_.size() == frames) seen_.erase(seen_.begin());
  seen_.push_back({std::move(cloud), stamp});
  if (seen_.size() < frames) return approach_;

  Vec3 towards = Vec3::Zero();
  if (!find_nearest(*seen_.back().cloud, tool, towards)) return approach_;
  const double size = towards.norm();
  towards /= size;
  std::array<double, frames> distances{};
  double expected = size;
  for (std::size_t i = frames; i-- > 0;) {
    distances[i] = expected = distance_along(*seen_[i].cloud, tool, towards, expected);
    if (std::isnan(expected)) return approach_;
  }
  double mean_t = 0.0;
  double mean_d = 0.0;
  for (std::size_t i = 0; i < frames; ++i) {
    mean_t += (seen_[i].stamp - stamp) / frames;
    mean_d += distances[i] / frames;
  }
  double tt = 0.0;
  double td = 0.0;
  for (std::size_t i = 0; i < frames; ++i) {
    const double t = seen_[i].stamp - stamp - mean_t;
    tt += t * t;
    td += t * (distances[i] - mean_d);
  }
  const double slope = td / tt;
  double squares = 0.0;
  for (std::size_t i = 0; i < frames; ++i) {
    const double left = distances[i] - mean_d - slope * (seen_[i].stamp - stamp - mean_t);
    squares += left * left;
  }
  // A few frames say little of their own noise; the last second says more.
  const double variance = squares / (frames - 2);
  variance_ = variance_ < 0.0 ? variance : variance_ + (variance - variance_) / noise_memory;
  const double error = std::sqrt(std::max(variance_, variance / surprise) / tt);
  if (!(-slope > (came ? 0.5 : 1.0) * least_speed &&
        -slope > (came ? 0.5 : 1.0) * least_ratio * error))
    return approach_;
  comes_ = true;
  approach_.speed = -slope;
  approach_.gap = std::max(mean_d - slope * mean_t, 0.0);
  approach_.away = -towards;
  return approach_;
}

}  // namespace palpate
