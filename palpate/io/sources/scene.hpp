// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/io/sources/shapes.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate {

/// How a part of a scene moves, in closed form.
///
/// From `start` on, with T = t - start, it is shifted along `direction` by
///   speed T + 1/2 acceleration T^2 + 1/2 stroke (1 - cos(2 pi frequency T))
/// and turned about `axis` through `pivot` by swing sin(2 pi frequency T). Before, it rests.
struct Motion {
  Vec3 direction = Vec3::UnitZ();  ///< [-] unit vector, world
  double start = 0.0;              ///< [s]
  double speed = 0.0;              ///< [m/s]
  double acceleration = 0.0;       ///< [m/s^2]
  double stroke = 0.0;             ///< [m] from one end to the other
  double frequency = 1.0;          ///< [Hz]
  double swing = 0.0;              ///< [rad] largest turn to either side
  Vec3 axis = Vec3::UnitY();       ///< [-] unit vector, world
  Vec3 pivot = Vec3::Zero();       ///< [m] world, before the shift

  [[nodiscard]] bool rests() const;
  /// Pose at time t relative to the pose at rest.
  [[nodiscard]] Eigen::Isometry3d at(double t) const;
  /// Velocity [m/s] at time t of the material that is at `point` [m, world] then.
  [[nodiscard]] Vec3 velocity(const Vec3& point, double t) const;
};

/// One body of a scene.
struct Part {
  Shape shape;
  Eigen::Isometry3d world_from_part = Eigen::Isometry3d::Identity();  ///< while it rests
  Motion motion;

  [[nodiscard]] Eigen::Isometry3d pose(double t) const { return motion.at(t) * world_from_part; }
};

/// The true surface near a point, at one time.
struct SurfacePoint {
  double distance;   ///< [m] from the surface to the asked point; negative inside
  Vec3 point;        ///< [m] on the surface, world
  Vec3 normal;       ///< [-] outward
  Vec3 velocity;     ///< [m/s] of the surface there
  std::size_t part;  ///< which of the scene's parts
};

/// Bodies with motion in closed form: the view of a synthetic camera, and its ground truth.
///
/// World frame: metres, z up; the bodies to touch lie about the origin.
class Scene {
 public:
  /// @throws Error if there is no part.
  explicit Scene(std::vector<Part> parts);

  [[nodiscard]] const std::vector<Part>& parts() const { return parts_; }

  /// The smallest s > 0 with origin + s direction on a surface at time t, or none.
  [[nodiscard]] std::optional<double> cast(const Vec3& origin, const Vec3& direction,
                                           double t) const;

  /// The surface nearest to a point, exact outside of all parts; inside, that of the part that the
  /// point is deepest in.
  [[nodiscard]] SurfacePoint nearest(const Vec3& point, double t) const;
  [[nodiscard]] double signed_distance(const Vec3& point, double t) const {
    return nearest(point, t).distance;
  }

 private:
  std::vector<Part> parts_;
};

/// The scene that a URI's path names, with its options: `synthetic:sphere?radius=40mm&speed=0.1`.
///
/// docs/synthetic.md has the options; others of the URI are ignored.
/// @throws Error for an unknown scene, naming the known ones, or a value out of range.
Scene make_scene(const Uri& uri);

/// A scene with a name.
struct SceneInfo {
  std::string_view name;
  std::string_view summary;  ///< what it is, one line
};

/// All named scenes.
std::span<const SceneInfo> known_scenes();

/// Every option that a scene takes. @throws Error as make_scene.
std::vector<std::string_view> scene_options(std::string_view name);

}  // namespace palpate
