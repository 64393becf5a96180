// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "palpate/kernel/core/observed_clouds.hpp"
#include "palpate/kernel/sight/contact_mode.hpp"
#include "palpate/kernel/sight/surface_estimate.hpp"

namespace palpate {

/// A layer of points along a beam.
struct Layer {
  double height;   ///< [m] median, from the beam's `through` towards the viewpoint
  double support;  ///< [-] its share of the beam's points
};

/// The layer nearest to the viewpoint that holds at least `least_share` of all heights. Layers
/// are runs without a gap of `gap` [m]. Sorts `heights`.
std::optional<Layer> first_layer(std::span<float> heights, double gap, double least_share) noexcept;

/// Sightline tracking: decides which of a frame's points belong to the surface that the proxy
/// touches, or that lies behind a free proxy on its line of sight. docs/sight.md, 2
/// and 3.
///
/// [servo] Nothing here allocates, locks or throws after construction.
class SightTracker {
 public:
  /// What became of the surface in a new frame.
  enum class Event {
    none,      ///< there is nothing to follow, or nothing that other cameras do not show better
    followed,  ///< it is where it was expected
    jumped,    ///< it is elsewhere on the line of sight
    hidden,    ///< by an occluder, or nothing was measured: held as it was
  };

  void set(const SightParameters& parameters) noexcept;
  /// Notes what a tick shows. What frames show the tracker notes itself.
  void note(Evidence evidence) noexcept { mode_ = next_mode(mode_, evidence); }

  /// Takes a camera's new frame into use: it alone says what is new, and where it does not show the
  /// surface the others' newest ones may.
  /// @param clouds     what each camera saw last, this frame included
  /// @param previous   what this camera saw before; null: nothing
  /// @param stamp     [s] of the frame
  /// @param interval  [s] after that camera's one before
  /// @param hip, proxy  [m] world
  /// @param hardest_strike  [m/s^2] a layer that would need a larger acceleration is an occluder;
  ///                        infinite for a surface that is not touched yet
  Event frame(const ObservedClouds& clouds, const Cloud* previous, std::size_t camera, double stamp,
              double interval, const Vec3& hip, const Vec3& proxy, double hardest_strike) noexcept;
  /// Looks for a surface to follow behind a proxy in free space, unless one is followed there.
  void watch(const ObservedClouds& clouds, const Vec3& proxy) noexcept;
  /// Follows the surface at a contact that was made with its points.
  /// @param foot    [m] world
  /// @param normal  [-] unit, world, towards the proxy
  void touch(const ObservedClouds& clouds, const Vec3& foot, const Vec3& normal) noexcept;
  /// Fits the surface anew around `foot` [m, world], a place on it. False if it ends before there.
  bool slide(const ObservedClouds& clouds, const Vec3& foot) noexcept;

  /// Where to put a proxy that passed through a surface on its way from `before` to `after` [m,
  /// world]: in front of it, on the line of sight through `after`, or of the fit, if that is in a
  /// hole of the image. None if it passed through nothing, or went round an edge.
  /// @param radius  [m] of the proxy
  [[nodiscard]] std::optional<Vec3> in_front(const ObservedClouds& clouds, const Vec3& before,
                                             const Vec3& after, double radius) noexcept;

  [[nodiscard]] ContactMode mode() const noexcept { return mode_; }
  [[nodiscard]] bool tracking() const noexcept { return is_followed(mode_); }
  /// Is the surface so well described by its fit that the proxy can rest on that?
  [[nodiscard]] bool smooth() const noexcept {
    return tracking() && (surface_.smooth() || holding() || is_shadowed(surface_.camera()));
  }
  [[nodiscard]] bool holding() const noexcept { return is_hidden(mode_); }
  [[nodiscard]] double held_since() const noexcept { return held_since_; }  ///< [s]

  /// The surface nearest to `point` [m, world] at time t [s]; only while `tracking`.
  [[nodiscard]] SurfaceContact contact(const Vec3& point, double t) const noexcept;
  /// Is that normal [-, world] within 70 degrees of the axis along which heights are measured?
  /// Steeper parts of a surface are not described by heights.
  [[nodiscard]] bool faces(const Vec3& normal) const noexcept {
    return surface_.frame().up.dot(normal) > 0.35;
  }
  /// How far the surface has moved at time t [s] since its frame [m, world]; only while `tracking`.
  [[nodiscard]] Vec3 displacement(double t) const noexcept {
    return surface_.displacement(t) * surface_.frame().up;
  }
  /// The estimate of the surface; only while `tracking`.
  [[nodiscard]] const SurfaceEstimate& surface() const noexcept { return surface_; }

 private:
  static constexpr std::size_t sectors = 8;
  static constexpr std::size_t bands = 5;
  using Ring = std::array<float, sectors * bands>;

  /// How much of the disc a camera sees.
  enum class Outline : std::uint8_t {
    whole,
    cut,      ///< something hides a part of it
    shadowed  ///< the same, and it arrived: the contact did not slide beside it
  };
  // How a camera sees the surface and what is beside it.
  struct View {
    double stamp = 0.0;            // [s] of its newest frame
    double interval = 1.0 / 30.0;  // [s]
    Outline outline = Outline::whole;
    Vec3 hip = Vec3::Zero();  // [m] world: where the hand rests
    double near_usual = 0.0;  // points of the surface in the beam without an occluder
    Ring beside = nothing_beside();
  };
  /// Where the surface is expected in a frame.
  struct Expectation {
    double rise;                // [m] since its last frame
    Vec2 foot;                  // [m] local: below the proxy
    Quadric surface;            // as it will lie there
    double gate;                // [m]
    Vec3 place = Vec3::Zero();  // [m] world: the foot
  };
  static constexpr std::size_t wide_beam_points = 512;
  /// What is seen there.
  struct Sighting {
    bool there = false;                           // the surface
    bool is_camera = false;                       // is the viewpoint known?
    Vec3 line = Vec3::UnitZ();                    // [-] unit, towards it
    std::size_t before = 0;                       // points between the viewpoint and the surface
    double near = 0.0;                            // points of the surface, thinned or not
    std::size_t seen = 0;                         // points in the beam
    std::array<float, wide_beam_points> heights;  // [m] of those, along the line
  };
  static Ring nothing_beside() noexcept;
  [[nodiscard]] Expectation expect(const Vec3& proxy, double elapsed) const noexcept;
  void gather_wide_beam(const Cloud& cloud, const Vec3& place) noexcept;
  void look_along(const Cloud& cloud, std::size_t camera, const Expectation& expected,
                  Sighting& sighting) noexcept;
  void outline(View& view, const Sighting& sighting, const Expectation& expected, const Vec3& hip,
               const Cloud* previous) noexcept;
  [[nodiscard]] std::size_t covering(const Cloud& cloud, const Expectation& expected) noexcept;

  void start(const ObservedClouds& clouds, std::size_t camera, const Vec3& foot,
             const Vec3& up) noexcept;
  [[nodiscard]] std::size_t best_camera(const ObservedClouds& clouds, const Vec3& place) noexcept;
  [[nodiscard]] bool others_show(const ObservedClouds& clouds, std::size_t camera,
                                 const Vec3& place, const Vec3& normal, double gate) noexcept;
  Event hold(double since) noexcept;
  Event lose() noexcept;
  [[nodiscard]] bool is_shadowed(std::size_t camera) const noexcept {
    return views_[camera].outline == Outline::shadowed;
  }
  /// The median of what is measured within `radius` [m] of the line of sight through `place`.
  struct Seen {
    double above;  // [m] `place`, towards the viewpoint
    Vec3 line;     // [-] unit, towards the viewpoint
  };
  [[nodiscard]] std::optional<Seen> look_at(const Cloud& cloud, const Vec3& place,
                                            double radius) noexcept;
  [[nodiscard]] bool is_shown(const ObservedClouds& clouds, const Vec3& foot,
                              const Vec3& normal) noexcept;
  [[nodiscard]] Ring look_beside(const Cloud& cloud, const Vec3& place) noexcept;
  [[nodiscard]] bool is_occluder(const Ring& before, const Ring& now, double height, double jump,
                                 double hardest_strike) const noexcept;

  Patch patch_;
  LocalPoints points_;  // of the patch
  SurfaceEstimate surface_;
  double least_share_ = SightParameters().least_share;
  ContactMode mode_ = ContactMode::free;
  double held_since_ = 0.0;
  std::array<View, Patch::max_views> views_;  // by camera
};

}  // namespace palpate
