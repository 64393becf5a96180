// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string_view>

#include "palpate/kernel/core/material.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

class DepthImage;
class PointCloud;

/// A narrow cone of lines of sight from the viewpoint through a place.
struct Beam {
  Vec3 through;   ///< [m] world: a place on its axis
  double radius;  ///< [m] of its cross-section there
  double reach;   ///< [m] how far it extends to both sides of `through`, along the axis
  /// [-] unit: the axis where a cloud does not know its viewpoint; the cone is a cylinder then.
  Vec3 axis;
};

/// Parameters for synthesising points on unseen side faces, in `Cloud::gather_sides`.
struct Sides {
  double jump;   ///< [m] a step in depth larger than this between neighbours is an edge
  double depth;  ///< [m] how far the side face reaches behind the edge
};

/// Parameters for synthesising points between coarse pixels, in `Cloud::gather_sheet`.
struct Sheet {
  double spacing;  ///< [m] points lie at most so far apart; finer pixels need none between them
  double jump;     ///< [m] neighbours whose depths differ by more are of two surfaces
};

/// Whatever can be touched: it can gather the points near a place into a patch.
///
/// Clouds are immutable once built, hence safe to read from any thread.
class Cloud {
 public:
  virtual ~Cloud() = default;

  /// Opens a view in `patch` and adds every point with |point - ball.centre| <= ball.radius.
  ///
  /// [servo] Bounded work, no allocation, no lock, no exception. If the ball holds more than
  /// `max_points`, an evenly thinned part of them is added and the patch is marked thinned.
  /// `patch.ball()` must be `ball`, or a ball about the same centre.
  virtual void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept = 0;

  /// Opens a view in `patch` and adds every point in the beam from the cloud's viewpoint.
  ///
  /// [servo] Bounded work, no allocation, no lock, no exception. If the beam holds more than
  /// `max_points`, an evenly thinned part of them is added and the patch is marked thinned.
  /// `patch.ball()` must be a ball about `beam.through`.
  virtual void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept = 0;

  /// Adds points of the ball where bodies that are seen from one side have their own: on the lines
  /// of sight that just meet the edge of a surface, from there to `sides.depth` behind it or to
  /// what is seen past it, as densely as pixels lie. None from a cloud without lines of sight.
  ///
  /// [servo] As `gather`.
  virtual void gather_sides(const Ball& /*ball*/, const Sides& /*sides*/,
                            std::size_t /*max_points*/, Patch& /*patch*/) const noexcept {}

  /// Adds points of the ball between those of pixels that are farther apart than `sheet.spacing`:
  /// on the surface through neighbouring pixels, and half a pixel on beyond its border. None from a
  /// cloud without pixels.
  ///
  /// [servo] As `gather`.
  virtual void gather_sheet(const Ball& /*ball*/, const Sheet& /*sheet*/,
                            std::size_t /*max_points*/, Patch& /*patch*/) const noexcept {}

  /// Adds points of the ball of which the cloud knows that they are of the material of that name.
  ///
  /// [servo] As `gather`.
  virtual void gather_of(std::string_view /*material*/, const Ball& /*ball*/,
                         std::size_t /*max_points*/, Patch& /*patch*/) const noexcept {}

  /// [m] between neighbouring points of a surface at `place` that faces the viewpoint: what a pixel
  /// spans there. 0 where that is not known.
  ///
  /// [servo] As `gather`.
  [[nodiscard]] virtual double spacing(const Vec3& /*place*/) const noexcept { return 0.0; }

  /// Does it know the noise of its own readings?
  [[nodiscard]] virtual bool has_noise() const noexcept { return false; }
  /// [m] Standard deviation of the depth that was read at `place` [m, world]: what the cloud knows
  /// of that reading, or else `usual` [m], which the noise model says (usual_noise_at).
  ///
  /// [servo] As `gather`.
  [[nodiscard]] virtual double noise_at(const Vec3& /*place*/, double usual) const noexcept {
    return usual;
  }

  /// Does it know what its surfaces are made of?
  [[nodiscard]] virtual bool has_materials() const noexcept { return false; }
  /// Does it know how bright they are?
  [[nodiscard]] virtual bool has_brightness() const noexcept { return false; }
  /// Is the scale of its depths in doubt? Then the safety chain limits the force.
  [[nodiscard]] virtual bool scale_unsure() const noexcept { return false; }

  /// Adds what is known of the surface about a place to `sample`, weighted by
  /// (1 - d^2 / radius^2)^2, d the distance along the surface: all of it that is within `radius`,
  /// or within a pixel and a half where pixels are coarser.
  /// @param place   [m] world, on the surface
  /// @param normal  [-] unit, of the surface
  ///
  /// [servo] As `gather`.
  virtual void sample(const Vec3& /*place*/, const Vec3& /*normal*/, double /*radius*/,
                      SurfaceSample& /*sample*/) const noexcept {}

  /// The cloud as a depth image; null if it is none, or of several clouds.
  [[nodiscard]] virtual const DepthImage* image() const noexcept { return nullptr; }
  /// The cloud as points without an order; null if it is none such, or of several clouds.
  [[nodiscard]] virtual const PointCloud* point_cloud() const noexcept { return nullptr; }
  /// The clouds that it is made of; empty if it is one by itself.
  [[nodiscard]] virtual std::span<const Cloud* const> parts() const noexcept { return {}; }
};

/// A beam as one viewpoint sees it.
class SightCone {
 public:
  SightCone(const Beam& beam, const std::optional<Vec3>& viewpoint) noexcept
      : reach_(beam.reach), radius_(beam.radius) {
    const Vec3 line = viewpoint ? Vec3(beam.through - *viewpoint) : Vec3::Zero();
    const double distance = line.norm();
    // A viewpoint at the place itself sees it along no line.
    seen_ = distance > beam.radius;
    axis_ = seen_ ? Vec3(line / distance) : beam.axis;
    widening_ = seen_ ? 1.0 / distance : 0.0;
  }

  /// Is a point in it? @param p  [m] relative to `through`, world axes
  [[nodiscard]] bool holds(const Vec3& p) const noexcept {
    const double along = p.dot(axis_);
    const double radius = radius_at(along);
    return std::abs(along) <= reach_ && radius > 0.0 &&
           p.squaredNorm() - along * along <= radius * radius;
  }

  /// May a ball of `radius` [m] about `centre` [m, relative to `through`, world axes] meet it? Also
  /// true of some that just miss it.
  [[nodiscard]] bool meets(const Vec3& centre, double radius) const noexcept {
    radius += 1e-9 * centre.lpNorm<1>();  // more than rounding
    const double along = centre.dot(axis_);
    const double away = radius + std::max(radius_at(along + radius), 0.0);
    // Whatever is not comparable may meet it.
    return !(std::abs(along) > reach_ + radius) &&
           !(centre.squaredNorm() - along * along > away * away);
  }

  /// [-] unit, away from the viewpoint where there is one.
  [[nodiscard]] const Vec3& axis() const noexcept { return axis_; }
  [[nodiscard]] double reach() const noexcept { return reach_; }
  /// [m] of the cross-section `along` [m] beyond `through`.
  [[nodiscard]] double radius_at(double along) const noexcept {
    return radius_ * (1.0 + widening_ * along);
  }

 private:
  Vec3 axis_;
  double reach_, radius_, widening_;
  bool seen_;
};

/// Empties `patch` and fills it with the points of `cloud` in `ball`. [servo]
inline void gather(const Cloud& cloud, const Ball& ball, Patch& patch) noexcept {
  patch.start(ball);
  cloud.gather(ball, Patch::capacity, patch);
}

/// Empties `patch` and fills it with at most `max_points` points of `cloud` in `beam`. [servo]
inline void gather(const Cloud& cloud, const Beam& beam, std::size_t max_points,
                   Patch& patch) noexcept {
  patch.start(Ball{beam.through, beam.reach});
  cloud.gather(beam, max_points, patch);
}

}  // namespace palpate
