// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "lab/method.hpp"

namespace palpate::lab::field {

/// A solid in its own axes.
struct Shape {
  using Cast = std::optional<double>(const Vec3& from, const Vec3& way, double reach, double t);

  /// [m] from the surface to `p` [m] at a time [s]; negative inside. At most the true one where it
  /// is large.
  std::function<double(const Vec3& p, double t)> distance;
  double radius;                     ///< [m] of a ball about the origin that holds it, or infinite
  std::function<Cast> known_cast{};  ///< as `cast`; none: by sphere tracing
  bool deforms = false;              ///< it changes its form with time

  /// [m] from `from` along the unit vector `way` to the surface, within `reach` [m]; none: it is
  /// not met.
  [[nodiscard]] std::optional<double> cast(const Vec3& from, const Vec3& way, double reach,
                                           double t) const;
};
using ShapePtr = std::shared_ptr<const Shape>;

/// All below z = 0.
ShapePtr ground();
ShapePtr ball(double radius);
/// @param half  [m] half of the edges
ShapePtr box(const Vec3& half);
/// A rod with round ends, its axis from (-half, 0, 0) to (half, 0, 0).
ShapePtr capsule(double half, double radius);
/// A disc or a can, its axis along z.
ShapePtr cylinder(double radius, double half);
/// A ring about the z axis. @param ring  [m] radius of its middle line @param tube  [m] of the tube
ShapePtr torus(double ring, double tube);
/// A spherical shell about the origin without what is above z = rim, open upwards.
/// @param inner  [m] radius inside @param wall [m] its thickness @param rim [m] |rim| < inner
ShapePtr bowl(double inner, double wall, double rim);

/// One bump of a terrain: height exp(-r^2 / 2 width^2).
struct Bump {
  double x, y;    ///< [m]
  double height;  ///< [m] negative: a hollow
  double width;   ///< [m]
};
ShapePtr terrain(std::vector<Bump> bumps);

/// One wave of a cloth, which travels: height sin(2 pi ((x cos + y sin) / length - frequency t)).
struct Wave {
  double height;                                            ///< [m] amplitude
  double length;                                            ///< [m]
  double frequency;                                         ///< [Hz]
  double heading;                                           ///< [rad]
  double phase;                                             ///< [rad]
  double begin = -std::numeric_limits<double>::infinity();  ///< [s] from which on it grows
  double end = std::numeric_limits<double>::infinity();     ///< [s] from which on it ebbs away
};
constexpr double swell = 1.0;  ///< [s] that a wave takes to grow, and to ebb away
ShapePtr cloth(std::vector<Wave> waves);

/// An ellipsoid whose half axes grow from `rest` by `breath` and shrink again, at `frequency`.
ShapePtr torso(const Vec3& rest, const Vec3& breath, double frequency);

/// [m] Semi-axes `half` [m]: the distance from the ellipsoid's surface to `p`, negative inside.
double ellipsoid_distance(const Vec3& half, const Vec3& p);

/// A solid that moves as a rigid body.
struct Body {
  ShapePtr shape;
  Eigen::Isometry3d rest = Eigen::Isometry3d::Identity();  ///< world from body, if it never moves
  std::function<Eigen::Isometry3d(double t)> motion{};     ///< world from body; none: at rest

  [[nodiscard]] bool still() const { return !motion && !shape->deforms; }
};

using FieldScene = std::vector<Body>;

/// A scene at one time.
class Snapshot {
 public:
  /// @param scene  must outlive this
  enum class Which { all, still, moving };
  Snapshot(const FieldScene& scene, double t, Which which = Which::all);

  /// [m] to the nearest body; negative inside one.
  [[nodiscard]] double distance(const Vec3& p) const;
  [[nodiscard]] TruePoint nearest(const Vec3& p) const;
  /// [m] along the unit vector `way` to the first body.
  [[nodiscard]] std::optional<double> cast(const Vec3& from, const Vec3& way, double reach) const;
  /// Does a body lie between two places? @param margin  [m] left out before `to`
  [[nodiscard]] bool between(const Vec3& from, const Vec3& to, double margin) const;
  [[nodiscard]] bool empty() const { return parts_.empty(); }
  [[nodiscard]] double t() const { return t_; }

 private:
  struct Part {
    const Shape* shape;
    Eigen::Isometry3d world_from_body;
    Eigen::Isometry3d body_from_world;
    double radius;
  };
  /// Null and infinity where there is none.
  [[nodiscard]] std::pair<const Part*, double> nearest_part(const Vec3& p) const;

  std::vector<Part> parts_;
  double t_;
};

/// The truth of a scene, which must outlive it. Quick where it is asked for one time after another.
Truth truth_of(const FieldScene& scene);

/// 0 to 1 with the least jerk, as a hand moves: 10 s^3 - 15 s^4 + 6 s^5, s cut to [0, 1].
double ease(double s);

}  // namespace palpate::lab::field
