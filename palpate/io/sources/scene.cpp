// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/scene.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "palpate/kernel/core/error.hpp"

namespace palpate {

bool Motion::rests() const {
  return speed == 0.0 && acceleration == 0.0 &&
         (frequency == 0.0 || (stroke == 0.0 && swing == 0.0));
}

Eigen::Isometry3d Motion::at(double t) const {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const double elapsed = t - start;
  if (!(elapsed > 0.0) || rests()) return pose;
  const double phase = 2.0 * std::numbers::pi * frequency * elapsed;
  const double shift =
      elapsed * (speed + 0.5 * acceleration * elapsed) + 0.5 * stroke * (1.0 - std::cos(phase));
  if (swing != 0.0)
    pose.linear() = Eigen::AngleAxisd(swing * std::sin(phase), axis).toRotationMatrix();
  pose.translation() = pivot - pose.linear() * pivot + shift * direction;
  return pose;
}

Vec3 Motion::velocity(const Vec3& point, double t) const {
  const double elapsed = t - start;
  if (!(elapsed > 0.0) || rests()) return Vec3::Zero();
  const double rate = 2.0 * std::numbers::pi * frequency;
  const double phase = rate * elapsed;
  const double shift_rate = speed + acceleration * elapsed + 0.5 * stroke * rate * std::sin(phase);
  const Vec3 turn_rate = swing * rate * std::cos(phase) * axis;
  const Vec3 pivot_now = at(t) * pivot;
  return shift_rate * direction + turn_rate.cross(point - pivot_now);
}

Scene::Scene(std::vector<Part> parts) : parts_(std::move(parts)) {
  if (parts_.empty()) throw Error("scene", "it has no part", "give at least one");
}

std::optional<double> Scene::cast(const Vec3& origin, const Vec3& direction, double t) const {
  std::array<double, 1> along{std::numeric_limits<double>::infinity()};
  for (const Part& part : parts_) {
    const Eigen::Isometry3d part_from_world = part.pose(t).inverse();
    const std::array<Vec3, 1> turned{part_from_world.linear() * direction};
    palpate::cast(part.shape, part_from_world * origin, turned, along);
  }
  if (!std::isfinite(along[0])) return std::nullopt;
  return along[0];
}

SurfacePoint Scene::nearest(const Vec3& point, double t) const {
  SurfacePoint best{};
  best.distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Eigen::Isometry3d world_from_part = parts_[i].pose(t);
    const Nearest local = palpate::nearest(parts_[i].shape, world_from_part.inverse() * point);
    if (local.distance < best.distance)
      best = {local.distance, world_from_part * local.point,
              world_from_part.linear() * local.normal, Vec3::Zero(), i};
  }
  best.velocity = parts_[best.part].motion.velocity(best.point, t);
  return best;
}

}  // namespace palpate
