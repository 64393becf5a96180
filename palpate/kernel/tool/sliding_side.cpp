// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/tool/sliding_side.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

constexpr std::size_t ways = 16;          // that are looked along, around a place in the image
constexpr std::size_t looked_along = 24;  // points, about, from which all ways are looked along
// [-] cosine and sine of the angle from one to the next.
constexpr double next_cos = 0.92387953251128674;
constexpr double next_sin = 0.38268343236508977;
constexpr double steepest_hold = 0.5;  // [-] cosine between the line of sight and what holds a tool

constexpr double newest_weight = 0.5;  // [-] of the newest frame in the speed
constexpr double slowest = 0.02;       // [m/s] A slower side is a surface like any other.

}  // namespace

void SlidingSide::find(const SeenSurface& seen, std::size_t camera, std::span<const Point> points,
                       const Vec3& normals) noexcept {
  const Vec3 hold = seen.to_camera(normals);
  const bool is_held = hold.z() < -steepest_hold * hold.norm();
  const auto along = [&](double x, double y) {
    return Vec3(x, y, is_held ? -(x * hold.x() + y * hold.y()) / hold.z() : 0.0);
  };
  // (12): ways on which it is as far, to a cell, are as good.
  const std::size_t step = 1 + points.size() / looked_along;
  const double cell = seen.cell_at(points[0].place);
  double nearest = std::numeric_limits<double>::infinity();
  std::array<double, ways> farthest{};
  std::array<Eigen::Vector2d, ways> way;
  way[0] = Eigen::Vector2d::UnitX();
  for (std::size_t i = 0; i < ways; ++i) {
    if (i > 0)
      way[i] = {next_cos * way[i - 1].x() - next_sin * way[i - 1].y(),
                next_sin * way[i - 1].x() + next_cos * way[i - 1].y()};
    for (std::size_t k = 0; k < points.size() && farthest[i] <= nearest + cell; k += step)
      farthest[i] =
          std::max(farthest[i], seen.way_out(points[k].place, along(way[i].x(), way[i].y())));
    nearest = std::min(nearest, farthest[i]);
  }
  const bool is_known = size_ > 0 && camera == camera_;
  const Vec3 motion = speed_ * normal_;
  size_ = 0;
  if (!(nearest < std::numeric_limits<double>::infinity())) return;
  const std::size_t first = std::min_element(farthest.begin(), farthest.end()) - farthest.begin();
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < ways; ++i)
    if (farthest[i] <= nearest + cell && way[i].dot(way[first]) > 0.0) mean += way[i];
  mean.normalize();
  way_ = along(mean.x(), mean.y());
  normal_ = seen.to_world(way_).normalized();
  camera_ = camera;
  for (const Point& point : points) {
    const double far = seen.way_out(point.place, way_);
    Held* to = &held_[std::min(size_, most_held - 1)];
    if (size_ < most_held) {
      ++size_;
    } else {
      to = std::min_element(held_.begin(), held_.end(),
                            [](const Held& a, const Held& b) { return a.far < b.far; });
      if (far <= to->far) continue;
    }
    *to = {point, far, normal_.dot(point.place) + far};
  }
  // A side that was lost a moment ago goes on, here where another part of the body slid.
  const double age = seen.stamp() - stamp_;
  const bool is_near = age >= 0.0 && age < longest * seen.interval();
  speed_ = is_near ? std::max(normal_.dot(motion), 0.0) : 0.0;
  move_to(seen, is_known);
}

void SlidingSide::follow(const SeenSurface& seen,
                         const Eigen::Isometry3d& world_from_tool) noexcept {
  std::size_t found = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    Held& held = held_[i];
    held.of.place = world_from_tool * held.of.at;
    const double back = seen.way_back(held.of.place, way_);
    held.far =
        std::isfinite(back) ? seen.way_out(held.of.place - back * normal_, way_) - back : back;
    held.out = std::max(normal_.dot(held.of.place) + held.far, held.out);
    if (std::isfinite(held.far)) held_[found++] = held;
  }
  size_ = found;
  if (found > 0) move_to(seen, true);
}

// (13): the side goes on as fast as the body slid over cells behind it.
void SlidingSide::move_to(const SeenSurface& seen, bool is_known) noexcept {
  double sum = 0.0, of = 0.0;
  for (const Held& held : std::span(held_.data(), size_)) {
    const double speed = seen.speed_along(held.of.place + held.far * normal_, way_);
    if (!(speed >= 0.0)) continue;
    sum += speed;
    of += 1.0;
  }
  if (of > 0.0) speed_ += (is_known ? newest_weight : 1.0) * (sum / of - speed_);
  stamp_ = seen.stamp();
  interval_ = seen.interval();
  if (is_known && speed_ < slowest) size_ = 0;
}

}  // namespace palpate
