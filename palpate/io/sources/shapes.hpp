// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <variant>
#include <vector>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

// Solid bodies in closed form, each in its own frame [m]. Scenes consist of them.

/// Everything at z <= 0.
struct HalfSpace {};

/// A ball about the origin.
struct Sphere {
  double radius;
};

/// A rod with round ends: all within `radius` of the y axis from -half_length to half_length.
struct Capsule {
  double radius, half_length;
};

/// A rod with flat ends, about the y axis.
struct Cylinder {
  double radius, half_length;
};

/// A polygon in the x-z plane, stretched along y from -half_length to half_length, even infinite.
struct Prism {
  std::vector<Eigen::Vector2d> outline;  ///< (x, z), counter-clockwise, without crossings
  double half_length;
};

/// Everything at z <= height/2 sin(2 pi x / length).
struct Wave {
  double height, length;  ///< from trough to crest, and from crest to crest
};

using Shape = std::variant<HalfSpace, Sphere, Capsule, Cylinder, Prism, Wave>;

/// A block about the origin with the edges' halves `half`.
Prism block(const Vec3& half);

/// The surface where it is nearest to a point.
struct Nearest {
  double distance;  ///< [m] from the surface to the point; negative inside the body
  Vec3 point;       ///< [m] on the surface
  Vec3 normal;      ///< [-] outward, along the line from `point` to the asked point
};

/// Exact to rounding (a Wave: to 1e-12 m), inside and outside.
Nearest nearest(const Shape& shape, const Vec3& point);

/// Where rays from one origin meet a shape: along[i] becomes the smallest s > 0 with
/// origin + s directions[i] on the surface, where that is smaller than what along[i] was.
void cast(const Shape& shape, const Vec3& origin, std::span<const Vec3> directions,
          std::span<double> along);

/// The edges' halves of a block about the origin that holds the shape; infinite where none does.
Vec3 bounding_half(const Shape& shape);

}  // namespace palpate
