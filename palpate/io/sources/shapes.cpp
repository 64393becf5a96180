// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/shapes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace palpate {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr double infinity = std::numeric_limits<double>::infinity();

Vec2 xz(const Vec3& v) { return {v.x(), v.z()}; }

// The smaller positive root of a s^2 + 2 b s + c = 0, or infinity.
double first_root(double a, double b, double c) {
  const double discriminant = b * b - a * c;
  if (!(discriminant >= 0.0) || a == 0.0) return infinity;
  // The form without cancellation; the product of the roots is c/a.
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  const double s1 = q / a;
  const double s2 = q == 0.0 ? s1 : c / q;
  const double low = std::min(s1, s2);
  const double high = std::max(s1, s2);
  return low > 0.0 ? low : high > 0.0 ? high : infinity;
}

Nearest about(const Vec3& centre, double radius, const Vec3& point) {
  const Vec3 offset = point - centre;
  const double distance = offset.norm();
  const Vec3 normal = distance > 0.0 ? Vec3(offset / distance) : Vec3::UnitZ();
  return {distance - radius, centre + radius * normal, normal};
}

// The point of an outline, in the x-z plane, that is nearest to a given one.
struct Nearest2 {
  double distance;
  Vec2 point, normal;
};

Nearest2 nearest_on_disc(double radius, const Vec2& p) {
  const double distance = p.norm();
  const Vec2 normal = distance > 0.0 ? Vec2(p / distance) : Vec2::UnitY();
  return {distance - radius, radius * normal, normal};
}

bool is_inside(const std::vector<Vec2>& outline, const Vec2& p) {
  bool inside = false;
  for (std::size_t i = 0, j = outline.size() - 1; i < outline.size(); j = i++) {
    const Vec2& a = outline[j];
    const Vec2& b = outline[i];
    if ((a.y() > p.y()) != (b.y() > p.y()) &&
        p.x() < a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x())) {
      inside = !inside;
    }
  }
  return inside;
}

Nearest2 nearest_on_outline(const std::vector<Vec2>& outline, const Vec2& p) {
  Nearest2 best{infinity, p, Vec2::UnitY()};
  for (std::size_t i = 0, j = outline.size() - 1; i < outline.size(); j = i++) {
    const Vec2 edge = outline[i] - outline[j];
    const double along = std::clamp(edge.dot(p - outline[j]) / edge.squaredNorm(), 0.0, 1.0);
    const Vec2 point = outline[j] + along * edge;
    const double distance = (p - point).norm();
    if (distance < best.distance) best = {distance, point, Vec2(edge.y(), -edge.x()).normalized()};
  }
  const double side = is_inside(outline, p) ? -1.0 : 1.0;
  // Within rounding of the surface the difference has no direction left: the edge's normal stays.
  if (best.distance > 1e-12) best.normal = side * (p - best.point) / best.distance;
  best.distance *= side;
  return best;
}

Nearest stretched(const Nearest2& flat, const Vec3& p, double half_length) {
  const double beyond = std::abs(p.y()) - half_length;
  const Vec3 end_normal(0.0, std::copysign(1.0, p.y()), 0.0);
  if (beyond <= 0.0 && (flat.distance > 0.0 || flat.distance >= beyond))
    return {flat.distance, Vec3(flat.point.x(), p.y(), flat.point.y()),
            Vec3(flat.normal.x(), 0.0, flat.normal.y())};
  const double y = std::copysign(half_length, p.y());
  if (flat.distance <= 0.0) return {beyond, Vec3(p.x(), y, p.z()), end_normal};
  const Vec3 point(flat.point.x(), y, flat.point.y());
  const double distance = (p - point).norm();
  return {distance, point, (p - point) / distance};
}

// Where the ray enters or leaves through a flat end whose face `holds` the point.
template <class Holds>
double cast_ends(double half_length, const Vec3& origin, const Vec3& direction,
                 const Holds& holds) {
  double first = infinity;
  if (direction.y() == 0.0) return first;
  for (const double y : {-half_length, half_length}) {
    const double s = (y - origin.y()) / direction.y();
    if (s > 0.0 && s < first && holds(xz(origin + s * direction))) first = s;
  }
  return first;
}

Nearest nearest_on(const HalfSpace& /*shape*/, const Vec3& p) {
  return {p.z(), Vec3(p.x(), p.y(), 0.0), Vec3::UnitZ()};
}

Nearest nearest_on(const Sphere& shape, const Vec3& p) {
  return about(Vec3::Zero(), shape.radius, p);
}

Nearest nearest_on(const Capsule& shape, const Vec3& p) {
  const double y = std::clamp(p.y(), -shape.half_length, shape.half_length);
  return about(Vec3(0.0, y, 0.0), shape.radius, p);
}

Nearest nearest_on(const Cylinder& shape, const Vec3& p) {
  return stretched(nearest_on_disc(shape.radius, xz(p)), p, shape.half_length);
}

Nearest nearest_on(const Prism& shape, const Vec3& p) {
  return stretched(nearest_on_outline(shape.outline, xz(p)), p, shape.half_length);
}

Nearest nearest_on(const Wave& shape, const Vec3& p) {
  const double a = 0.5 * shape.height;
  const double k = 2.0 * std::numbers::pi / shape.length;
  const auto squared = [&](double x) {
    const double dz = a * std::sin(k * x) - p.z();
    return (x - p.x()) * (x - p.x()) + dz * dz;
  };
  // Half the derivative of `squared`.
  const auto slope = [&](double x) {
    return x - p.x() + (a * std::sin(k * x) - p.z()) * a * k * std::cos(k * x);
  };
  // The surface repeats: what is nearest lies within half a wave.
  constexpr int samples = 64;
  const double pitch = shape.length / samples;
  double best = p.x();
  double least = squared(best);
  for (int i = -samples / 2; i <= samples / 2; ++i) {
    const double x = p.x() + i * pitch;
    const double here = squared(x);
    if (here >= least) continue;
    best = x;
    least = here;
  }
  double low = best - pitch;
  double high = best + pitch;
  for (int i = 0; i < 60; ++i) {
    best = 0.5 * (low + high);
    (slope(best) > 0.0 ? high : low) = best;
  }
  const double angle = k * best;
  const Vec3 point(best, p.y(), a * std::sin(angle));
  const Vec3 up = Vec3(-a * k * std::cos(angle), 0.0, 1.0).normalized();
  const double side = p.z() < a * std::sin(k * p.x()) ? -1.0 : 1.0;
  const double distance = (p - point).norm();
  return {side * distance, point, distance > 1e-9 ? Vec3(side * (p - point) / distance) : up};
}

double cast_on(const HalfSpace& /*shape*/, const Vec3& origin, const Vec3& direction) {
  const double s = -origin.z() / direction.z();
  return s > 0.0 ? s : infinity;  // also where the ray is parallel
}

double cast_on(const Sphere& shape, const Vec3& origin, const Vec3& direction) {
  return first_root(direction.squaredNorm(), direction.dot(origin),
                    origin.squaredNorm() - shape.radius * shape.radius);
}

// The first of both roots of the round side that lies between the ends.
double cast_side(double radius, double half_length, const Vec3& origin, const Vec3& direction) {
  const Vec2 d = xz(direction);
  const Vec2 o = xz(origin);
  const double a = d.squaredNorm();
  const double b = d.dot(o);
  const double discriminant = b * b - a * (o.squaredNorm() - radius * radius);
  if (!(discriminant >= 0.0) || a == 0.0) return infinity;
  const double root = std::sqrt(discriminant);
  for (const double s : {(-b - root) / a, (-b + root) / a}) {
    if (s > 0.0 && std::abs(origin.y() + s * direction.y()) <= half_length) return s;
  }
  return infinity;
}

double cast_on(const Capsule& shape, const Vec3& origin, const Vec3& direction) {
  double first = cast_side(shape.radius, shape.half_length, origin, direction);
  for (const double y : {-shape.half_length, shape.half_length}) {
    // Only the half of each ball that looks outward is surface.
    const Vec3 centre(0.0, y, 0.0);
    const double a = direction.squaredNorm();
    const double b = direction.dot(origin - centre);
    const double discriminant =
        b * b - a * ((origin - centre).squaredNorm() - shape.radius * shape.radius);
    if (!(discriminant >= 0.0)) continue;
    const double root = std::sqrt(discriminant);
    for (const double s : {(-b - root) / a, (-b + root) / a}) {
      if (s > 0.0 && s < first && (origin.y() + s * direction.y() - y) * y >= 0.0) first = s;
    }
  }
  return first;
}

double cast_on(const Cylinder& shape, const Vec3& origin, const Vec3& direction) {
  return std::min(cast_side(shape.radius, shape.half_length, origin, direction),
                  cast_ends(shape.half_length, origin, direction, [&](const Vec2& p) {
                    return p.squaredNorm() <= shape.radius * shape.radius;
                  }));
}

double cast_on(const Prism& shape, const Vec3& origin, const Vec3& direction) {
  double first = cast_ends(shape.half_length, origin, direction,
                           [&](const Vec2& p) { return is_inside(shape.outline, p); });
  const Vec2 d = xz(direction);
  const Vec2 o = xz(origin);
  for (std::size_t i = 0, j = shape.outline.size() - 1; i < shape.outline.size(); j = i++) {
    const Vec2 edge = shape.outline[i] - shape.outline[j];
    const Vec2 to_edge = shape.outline[j] - o;
    const double across = d.x() * edge.y() - d.y() * edge.x();
    const double s = (to_edge.x() * edge.y() - to_edge.y() * edge.x()) / across;
    if (!(s > 0.0 && s < first)) continue;
    const double along = (to_edge.x() * d.y() - to_edge.y() * d.x()) / across;
    constexpr double rounding = 1e-12;  // no crack between two edges
    if (along >= -rounding && along <= 1.0 + rounding &&
        std::abs(origin.y() + s * direction.y()) <= shape.half_length) {
      first = s;
    }
  }
  return first;
}

double cast_on(const Wave& shape, const Vec3& origin, const Vec3& direction) {
  const double a = 0.5 * shape.height;
  const double k = 2.0 * std::numbers::pi / shape.length;
  double s = 0.0;
  if (origin.z() > a) {
    if (!(direction.z() < 0.0)) return infinity;
    s = (a - origin.z()) / direction.z();
  }
  // g is the height over the wave along the ray and |g''| <= bend, so a step to the zero of the
  // parabola below |g| never passes a surface, and it converges quadratically.
  const double bend = a * k * k * direction.x() * direction.x();
  constexpr int most_steps = 10000;  // only a ray that runs along the crests comes near
  for (int i = 0; i < most_steps; ++i) {
    const double angle = k * (origin.x() + s * direction.x());
    const double z = origin.z() + s * direction.z();
    const double g = z - a * std::sin(angle);
    // Nearer than this, rounding may have the sign of g wrong.
    if (std::abs(g) < 1e-13 && s > 0.0) return s;
    if (std::abs(z) > a && z * direction.z() > 0.0) return infinity;  // left the waves for good
    const double rate = direction.z() - a * k * std::cos(angle) * direction.x();
    const double towards = g < 0.0 ? rate : -rate;
    const double root = std::sqrt(towards * towards + 2.0 * bend * std::abs(g));
    s += towards > 0.0 ? 2.0 * std::abs(g) / (towards + root) : (root - towards) / bend;
    if (std::abs(g) < 1e-8 && s > 0.0) return s;  // this far out, the step just made leaves 1e-12
    if (!(s < 1e6)) return infinity;
  }
  return infinity;
}

Vec3 half_of(const HalfSpace& /*shape*/) { return Vec3::Constant(infinity); }
Vec3 half_of(const Sphere& shape) { return Vec3::Constant(shape.radius); }
Vec3 half_of(const Capsule& shape) {
  return {shape.radius, shape.radius + shape.half_length, shape.radius};
}
Vec3 half_of(const Cylinder& shape) { return {shape.radius, shape.half_length, shape.radius}; }
Vec3 half_of(const Prism& shape) {
  Vec2 half = Vec2::Zero();
  for (const Vec2& p : shape.outline) half = half.cwiseMax(p.cwiseAbs());
  return {half.x(), shape.half_length, half.y()};
}
Vec3 half_of(const Wave& /*shape*/) { return Vec3::Constant(infinity); }

}  // namespace

Prism block(const Vec3& half) {
  return {{Vec2(-half.x(), -half.z()), Vec2(half.x(), -half.z()), Vec2(half.x(), half.z()),
           Vec2(-half.x(), half.z())},
          half.y()};
}

Nearest nearest(const Shape& shape, const Vec3& point) {
  return std::visit([&](const auto& body) { return nearest_on(body, point); }, shape);
}

void cast(const Shape& shape, const Vec3& origin, std::span<const Vec3> directions,
          std::span<double> along) {
  std::visit(
      [&](const auto& body) {
        for (std::size_t i = 0; i < directions.size(); ++i)
          along[i] = std::min(along[i], cast_on(body, origin, directions[i]));
      },
      shape);
}

Vec3 bounding_half(const Shape& shape) {
  return std::visit([](const auto& body) { return half_of(body); }, shape);
}

}  // namespace palpate
