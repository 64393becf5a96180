// SPDX-License-Identifier: Apache-2.0
#include "lab/field/field_scene.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "palpate/kernel/core/mathematics.hpp"

namespace palpate::lab::field {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr double touches = 5e-6;  // [m] from a surface: a ray that comes so near has met it
constexpr double infinite = std::numeric_limits<double>::infinity();

// Where a ray from outside meets a ball about the origin: entry and exit [m]; none if it does not.
std::optional<std::pair<double, double>> through_ball(const Vec3& from, const Vec3& way,
                                                      double radius) {
  const double middle = -from.dot(way);
  const double squared = radius * radius - (from + middle * way).squaredNorm();
  if (squared < 0.0) return std::nullopt;
  const double half = std::sqrt(squared);
  return std::pair{middle - half, middle + half};
}

// The first of a ray's two crossings that lies ahead.
std::optional<double> ahead(double entry, double exit, double reach) {
  if (exit < 0.0 || entry > reach) return std::nullopt;
  return std::max(entry, 0.0);
}

ShapePtr solid(Shape shape) { return std::make_shared<const Shape>(std::move(shape)); }

struct Height {
  double z;
  double along_x, along_y;  // its derivatives
};
using HeightAt = std::function<Height(double x, double y, double t)>;

double distance_from(const HeightAt& height, double steepest, const Vec3& p, double t) {
  const Height below = height(p.x(), p.y(), t);
  const double above = p.z() - below.z;
  const double safe = above / std::sqrt(1.0 + steepest * steepest);
  constexpr double near = 0.04;  // [m] nearer than this the foot of the perpendicular is found
  if (std::abs(safe) > near) return safe;
  double x = p.x();
  double y = p.y();
  double best = std::abs(above);
  for (int i = 0; i < 6; ++i) {
    // The foot on the tangent plane is the next place.
    const Height at = height(x, y, t);
    const Vec3 normal = Vec3(-at.along_x, -at.along_y, 1.0).normalized();
    const Vec3 foot = p - normal.dot(p - Vec3(x, y, at.z)) * normal;
    x = foot.x();
    y = foot.y();
    const double found = (p - Vec3(x, y, height(x, y, t).z)).norm();
    const double gain = best - found;
    best = std::min(best, found);
    if (std::abs(gain) < 1e-13) break;
  }
  return std::copysign(best, above);
}

// A surface that has one height at each place.
// @param highest   [m] no place is higher
// @param steepest  [-] no place is steeper
ShapePtr relief(const HeightAt& height, double highest, double steepest, bool deforms) {
  const auto cast = [=](const Vec3& from, const Vec3& way, double reach,
                        double t) -> std::optional<double> {
    double gone = 0.0;
    if (from.z() > highest) {
      if (way.z() >= 0.0) return std::nullopt;
      gone = (highest - from.z()) / way.z();
    }
    const double slow = 1.0 / (steepest * way.head<2>().norm() + std::abs(way.z()));
    for (int i = 0; i < 400 && gone <= reach; ++i) {
      const Vec3 p = from + gone * way;
      const double above = p.z() - height(p.x(), p.y(), t).z;
      if (above < touches) return gone;
      if (p.z() > highest + 1e-9 && way.z() >= 0.0) return std::nullopt;
      gone += above * slow;  // it cannot be met sooner
    }
    return std::nullopt;
  };
  return solid({[=](const Vec3& p, double t) { return distance_from(height, steepest, p, t); },
                infinite, cast, deforms});
}

}  // namespace

std::optional<double> Shape::cast(const Vec3& from, const Vec3& way, double reach, double t) const {
  if (known_cast) return known_cast(from, way, reach, t);
  double gone = 0.0;
  double end = reach;
  if (std::isfinite(radius)) {
    const auto crossed = through_ball(from, way, radius + touches);
    if (!crossed || crossed->second < 0.0) return std::nullopt;
    gone = std::max(crossed->first, 0.0);
    end = std::min(crossed->second, reach);
  }
  constexpr int most_steps = 400;
  for (int i = 0; i < most_steps && gone <= end; ++i) {
    const double room = distance(from + gone * way, t);
    if (room < touches) return gone;
    gone += room;
  }
  return std::nullopt;
}

ShapePtr ground() {
  const auto cast = [](const Vec3& from, const Vec3& way, double reach,
                       double /*t*/) -> std::optional<double> {
    if (from.z() <= 0.0) return 0.0;
    if (way.z() >= 0.0) return std::nullopt;
    const double gone = -from.z() / way.z();
    return gone <= reach ? std::optional(gone) : std::nullopt;
  };
  return solid({[](const Vec3& p, double /*t*/) { return p.z(); }, infinite, cast});
}

ShapePtr ball(double radius) {
  const auto cast = [=](const Vec3& from, const Vec3& way, double reach, double /*t*/) {
    const auto crossed = through_ball(from, way, radius);
    return crossed ? ahead(crossed->first, crossed->second, reach) : std::nullopt;
  };
  return solid({[=](const Vec3& p, double /*t*/) { return p.norm() - radius; }, radius, cast});
}

ShapePtr box(const Vec3& half) {
  const auto cast = [=](const Vec3& from, const Vec3& way, double reach,
                        double /*t*/) -> std::optional<double> {
    double entry = -infinite;
    double exit = infinite;
    for (int i = 0; i < 3; ++i) {
      if (way[i] == 0.0) {
        if (std::abs(from[i]) > half[i]) return std::nullopt;
        continue;
      }
      const double one = (-half[i] - from[i]) / way[i];
      const double other = (half[i] - from[i]) / way[i];
      entry = std::max(entry, std::min(one, other));
      exit = std::min(exit, std::max(one, other));
    }
    return entry <= exit ? ahead(entry, exit, reach) : std::nullopt;
  };
  const auto distance = [=](const Vec3& p, double /*t*/) {
    const Vec3 beyond = p.cwiseAbs() - half;
    return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
  };
  return solid({distance, half.norm(), cast});
}

ShapePtr capsule(double half, double radius) {
  const auto distance = [=](const Vec3& p, double /*t*/) {
    return (p - Vec3(std::clamp(p.x(), -half, half), 0.0, 0.0)).norm() - radius;
  };
  const auto cast = [=](const Vec3& from, const Vec3& way, double reach,
                        double t) -> std::optional<double> {
    if (distance(from, t) <= 0.0) return 0.0;
    std::optional<double> first;
    const auto keep = [&](std::optional<double> met) {
      if (met && (!first || *met < *first)) first = met;
    };
    // The tube: |(y, z)| = radius, where x is between the ends.
    const Vec2 origin = from.tail<2>();
    const Vec2 across = way.tail<2>();
    const double a = across.squaredNorm();
    const double b = origin.dot(across);
    const double squared = b * b - a * (origin.squaredNorm() - radius * radius);
    if (a > 0.0 && squared >= 0.0) {
      const double gone = (-b - std::sqrt(squared)) / a;
      if (gone >= 0.0 && gone <= reach && std::abs(from.x() + gone * way.x()) <= half) keep(gone);
    }
    for (const double end : {-half, half}) {
      const auto crossed = through_ball(from - Vec3(end, 0.0, 0.0), way, radius);
      if (crossed) keep(ahead(crossed->first, crossed->second, reach));
    }
    return first;
  };
  return solid({distance, half + radius, cast});
}

ShapePtr cylinder(double radius, double half) {
  const auto distance = [=](const Vec3& p, double /*t*/) {
    const Vec2 beyond(p.head<2>().norm() - radius, std::abs(p.z()) - half);
    return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
  };
  return solid({distance, math::hypot(radius, half)});
}

ShapePtr torus(double ring, double tube) {
  const auto distance = [=](const Vec3& p, double /*t*/) {
    return math::hypot(p.head<2>().norm() - ring, p.z()) - tube;
  };
  return solid({distance, ring + tube});
}

ShapePtr bowl(double inner, double wall, double rim) {
  const double middle = inner + 0.5 * wall;
  const double half_wall = 0.5 * wall;
  const Vec2 end(std::sqrt(middle * middle - rim * rim), rim);  // [m] from the axis, and z
  const auto distance = [=](const Vec3& p, double /*t*/) {
    // In the plane through p and the axis the wall is an arc, drawn with a round pen.
    const Vec2 q(p.head<2>().norm(), p.z());
    const bool beyond_rim = end.y() * q.x() < end.x() * q.y();
    return (beyond_rim ? (q - end).norm() : std::abs(q.norm() - middle)) - half_wall;
  };
  return solid({distance, middle + half_wall});
}

ShapePtr terrain(std::vector<Bump> bumps) {
  double highest = 0.0;
  double steepest = 0.0;
  for (const Bump& bump : bumps) {
    highest += std::max(bump.height, 0.0);
    steepest += std::abs(bump.height) / bump.width * math::exp(-0.5);
  }
  const auto height = [bumps = std::move(bumps)](double x, double y, double /*t*/) {
    Height sum{0.0, 0.0, 0.0};
    for (const Bump& bump : bumps) {
      const double narrow = 1.0 / (bump.width * bump.width);
      const double dx = x - bump.x;
      const double dy = y - bump.y;
      const double part = bump.height * math::exp(-0.5 * (dx * dx + dy * dy) * narrow);
      sum.z += part;
      sum.along_x -= dx * narrow * part;
      sum.along_y -= dy * narrow * part;
    }
    return sum;
  };
  return relief(height, highest, steepest, false);
}

ShapePtr cloth(std::vector<Wave> waves) {
  double highest = 0.0;
  double steepest = 0.0;
  for (const Wave& wave : waves) {
    highest += wave.height;
    steepest += 2.0 * std::numbers::pi * wave.height / wave.length;
  }
  const auto height = [waves = std::move(waves)](double x, double y, double t) {
    Height sum{0.0, 0.0, 0.0};
    for (const Wave& wave : waves) {
      const double k = 2.0 * std::numbers::pi / wave.length;
      const double kx = k * math::cos(wave.heading);
      const double ky = k * math::sin(wave.heading);
      const double angle =
          kx * x + ky * y - 2.0 * std::numbers::pi * wave.frequency * t + wave.phase;
      const double tall =
          wave.height * ease((t - wave.begin) / swell) * (1.0 - ease((t - wave.end) / swell));
      const double slope = tall * math::cos(angle);
      sum.z += tall * math::sin(angle);
      sum.along_x += kx * slope;
      sum.along_y += ky * slope;
    }
    return sum;
  };
  return relief(height, highest, steepest, true);
}

ShapePtr torso(const Vec3& rest, const Vec3& breath, double frequency) {
  const auto half = [=](double t) {
    return Vec3(rest + 0.5 * (1.0 - math::cos(2.0 * std::numbers::pi * frequency * t)) * breath);
  };
  const auto cast = [=](const Vec3& from, const Vec3& way, double reach, double t) {
    // Where its axes are shrunk to 1 it is a ball.
    const Vec3 half_axes = half(t);
    const Vec3 shrunk = way.cwiseQuotient(half_axes);
    const double scale = shrunk.norm();
    const auto crossed = through_ball(from.cwiseQuotient(half_axes), shrunk / scale, 1.0);
    return crossed ? ahead(crossed->first / scale, crossed->second / scale, reach) : std::nullopt;
  };
  return solid({[=](const Vec3& p, double t) { return ellipsoid_distance(half(t), p); },
                (rest + breath).maxCoeff(), cast, true});
}

double ellipsoid_distance(const Vec3& half, const Vec3& p) {
  // The foot is half_i^2 q_i / (half_i^2 + s), where s is the largest root of
  // sum (half_i q_i / (half_i^2 + s))^2 = 1: to its left the sum is convex and falls, so Newton's
  // method from there comes nearer with each step and never passes it.
  const Vec3 q = p.cwiseAbs().cwiseMax(1e-9);
  const Vec3 squared = half.cwiseProduct(half);
  double s = (half.cwiseProduct(q) - squared).maxCoeff();
  for (int i = 0; i < 50; ++i) {
    double sum = -1.0;
    double slope = 0.0;
    for (int k = 0; k < 3; ++k) {
      const double part = half[k] * q[k] / (squared[k] + s);
      sum += part * part;
      slope -= 2.0 * part * part / (squared[k] + s);
    }
    const double step = -sum / slope;
    s += step;
    if (std::abs(step) < 1e-13) break;
  }
  Vec3 foot;
  for (int k = 0; k < 3; ++k) foot[k] = squared[k] * q[k] / (squared[k] + s);
  return std::copysign((q - foot).norm(), s);
}

Snapshot::Snapshot(const FieldScene& scene, double t, Which which) : t_(t) {
  for (const Body& body : scene) {
    if (which != Which::all && body.still() != (which == Which::still)) continue;
    const Eigen::Isometry3d pose = body.motion ? body.motion(t) : body.rest;
    parts_.push_back({body.shape.get(), pose, pose.inverse(), body.shape->radius});
  }
}

std::pair<const Snapshot::Part*, double> Snapshot::nearest_part(const Vec3& p) const {
  std::pair<const Part*, double> nearest = {nullptr, infinite};
  for (const Part& part : parts_) {
    const Vec3 local = part.body_from_world * p;
    if (std::isfinite(part.radius) && local.norm() - part.radius > nearest.second) continue;
    const double distance = part.shape->distance(local, t_);
    if (distance < nearest.second) nearest = {&part, distance};
  }
  return nearest;
}

double Snapshot::distance(const Vec3& p) const { return nearest_part(p).second; }

TruePoint Snapshot::nearest(const Vec3& p) const {
  const auto [part, distance] = nearest_part(p);
  if (part == nullptr) return {distance, Vec3::UnitZ()};
  constexpr double h = 1e-6;  // [m]
  const Vec3 local = part->body_from_world * p;
  Vec3 slope;
  for (int i = 0; i < 3; ++i) {
    const Vec3 step = h * Vec3::Unit(i);
    slope[i] = part->shape->distance(local + step, t_) - part->shape->distance(local - step, t_);
  }
  const double length = slope.norm();
  return {distance, length > 0.0 ? Vec3(part->world_from_body.linear() * (slope / length))
                                 : Vec3(Vec3::UnitZ())};
}

std::optional<double> Snapshot::cast(const Vec3& from, const Vec3& way, double reach) const {
  std::optional<double> first;
  for (const Part& part : parts_) {
    const auto met =
        part.shape->cast(part.body_from_world * from, part.body_from_world.linear() * way,
                         first.value_or(reach), t_);
    if (met && (!first || *met < *first)) first = met;
  }
  return first;
}

bool Snapshot::between(const Vec3& from, const Vec3& to, double margin) const {
  const Vec3 line = to - from;
  const double length = line.norm();
  return length > margin && cast(from, line / length, length - margin).has_value();
}

Truth truth_of(const FieldScene& scene) {
  return [&scene, newest = std::make_shared<Snapshot>(scene, 0.0)](const Vec3& p, double t) {
    if (newest->t() != t) *newest = Snapshot(scene, t);
    return newest->nearest(p);
  };
}

double ease(double s) {
  s = std::clamp(s, 0.0, 1.0);
  return s * s * s * (10.0 + s * (6.0 * s - 15.0));
}

}  // namespace palpate::lab::field
