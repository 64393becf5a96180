// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "palpate/core/cloud.hpp"
#include "palpate/core/height_track.hpp"
#include "palpate/core/surface_fit.hpp"

namespace palpate {

/// A layer of points along a beam.
struct Layer {
  double height;   ///< [m] median, from the beam's `through` towards the viewpoint
  double support;  ///< [-] its share of the beam's points
};

/// The layer nearest to the viewpoint that holds at least `least_support` of all heights. Layers
/// are runs without a gap of `gap` [m]. Sorts `heights`.
std::optional<Layer> first_layer(std::span<float> heights, double gap,
                                 double least_support) noexcept;

/// A sphere on the surface that is followed.
struct SurfaceContact {
  Vec3 foot;        ///< [m] world: the surface's point nearest to the point asked about
  Vec3 normal;      ///< [-] unit, world, towards the proxy's side
  double distance;  ///< [m] from the surface to that point, negative behind it
  bool at_limit;    ///< the surface is not known beyond `foot`: fit it there
  double
      curvature;  ///< [1/m] the strongest towards the proxy: a sphere of 1/curvature just fits in
};

/// Sightline tracking: what the Renderer remembers of the surface that the proxy touches, or that
/// lies behind it on its line of sight. docs/method.md, "Sight".
///
/// [servo] Nothing here allocates, locks or throws after construction.
class SightTracker {
 public:
  /// What became of the surface in a new frame.
  enum class Event {
    none,      ///< there is nothing to follow
    followed,  ///< it is where it was expected
    jumped,    ///< it is elsewhere on the line of sight
    hidden,    ///< something came before it, or nothing was measured: held as it was
  };

  void forget() noexcept { tracking_ = false; }

  /// Takes a new frame into use. @param proxy  [m] world
  /// @param hardest_strike  [m/s^2] what jumps harder than that came between; infinite for a
  ///                        surface that is only watched, which is believed
  Event frame(const Cloud& cloud, double stamp, double interval, const Vec3& proxy,
              double hardest_strike) noexcept;
  /// Looks for a surface to follow behind a proxy in free space, unless one is followed there.
  void watch(const Cloud& cloud, const Vec3& proxy) noexcept;
  /// Follows the surface at a contact that was made with its points.
  /// @param foot    [m] world
  /// @param normal  [-] unit, world, towards the proxy
  void touch(const Cloud& cloud, const Vec3& foot, const Vec3& normal) noexcept;

  /// Does the frame show a proxy that ought to be in front of the surface behind it? An audit: the
  /// median of what is measured on its line of sight, independent of the fit.
  /// @param radius  [m] of the footprint
  [[nodiscard]] bool shows_behind(const Cloud& cloud, const Vec3& proxy, double radius) noexcept;
  /// Fits the surface anew around `foot` [m, world], a place on it. False if it ends before there.
  bool slide(const Cloud& cloud, const Vec3& foot) noexcept;

  [[nodiscard]] bool tracking() const noexcept { return tracking_; }
  /// Is the surface so well described by its fit that the proxy can rest on that?
  [[nodiscard]] bool smooth() const noexcept {
    return tracking_ && (smooth_ || holding_ || shadowed_);
  }
  [[nodiscard]] bool holding() const noexcept { return tracking_ && holding_; }
  [[nodiscard]] double held_since() const noexcept { return held_since_; }  ///< [s]

  /// The surface nearest to `point` [m, world] at time t [s]; only while `tracking`.
  [[nodiscard]] SurfaceContact contact(const Vec3& point, double t) const noexcept;
  /// [m/s] along `up`.
  [[nodiscard]] double velocity() const noexcept { return holding_ ? 0.0 : velocity_; }
  /// How far the surface has moved along `up` at time t since its frame [m].
  [[nodiscard]] double travel(double t) const noexcept;
  [[nodiscard]] const Vec3& up() const noexcept { return frame_.up; }
  /// Spread of the measured points about the surface [m]: how far noise can reach.
  [[nodiscard]] double spread() const noexcept { return spread_; }
  /// Standard deviation of one frame's height of the surface [m], as measured.
  [[nodiscard]] double height_sd() const noexcept;
  /// How far the newest frame's own points may lie above the averaged surface [m].
  [[nodiscard]] double clearance() const noexcept {
    return std::max(above_mean_, 0.0) + 3.0 * spread_;
  }
  /// [m] over which the surface is averaged now.
  [[nodiscard]] double support_radius() const noexcept { return radii[rung_]; }

  static constexpr std::size_t rungs = 6;
  static constexpr std::array<double, rungs> radii = {7e-3, 11e-3, 17e-3, 27e-3, 42e-3, 60e-3};

 private:
  static constexpr std::size_t history = most_heights;
  static constexpr std::size_t cells_per_side = 4;
  static constexpr std::size_t cells = cells_per_side * cells_per_side;
  static constexpr std::size_t sectors = 8;
  static constexpr std::size_t bands = 5;

  /// Moments with the height eliminated (Schur's complement): what is left tells of the shape.
  struct Shape {
    Eigen::Matrix<double, 5, 5> matrix;
    Eigen::Matrix<double, 5, 1> right_side;
    Eigen::Matrix<double, 5, 1> means;  // of x, y, xx, xy, yy
    double height;                      // mean z [cm]
    double points;
  };
  /// What one frame said.
  struct Evidence {
    double stamp = 0.0;
    Vec2 centre = Vec2::Zero();
    bool whole = true;      // nothing was before a part of it
    std::size_t rungs = 0;  // how many were measured
    std::array<Moments, SightTracker::rungs> disc;
    std::array<Shape, SightTracker::rungs> shape;
  };
  /// Means over the points in each cell of a square about a frame's contact, local.
  struct Cells {
    bool full = false;  // no cell is without points, and nothing was before them
    Vec2 centre = Vec2::Zero();
    std::array<float, cells> heights;                     // [m]
    std::array<Eigen::Matrix<float, 6, 1>, cells> means;  // of quadric_basis
  };
  static constexpr std::size_t cell_frames = 8;
  /// How a height scatters from frame to frame.
  struct Scatter {
    double variance = 0.0;  // [m^2]
    double samples = 0.0;
  };
  struct Residuals {
    float median;      // [m]
    double deviation;  // [m] as of a normal distribution
  };
  using Ring = std::array<float, sectors * bands>;

  bool start(const Cloud& cloud, const Vec3& foot, const Vec3& up) noexcept;
  bool measure(const Cloud& cloud, const Vec2& foot, double stamp, bool new_frame, double gate,
               bool jumped = false) noexcept;
  [[nodiscard]] std::optional<Residuals> residuals(const Vec2& foot, double radius,
                                                   double wide) const noexcept;
  bool recentre(const Vec2& foot, double gate, double& cut) noexcept;
  void estimate(const Vec2& foot, bool new_frame) noexcept;
  void look_at_cells(const Vec2& foot, double wide, bool new_frame) noexcept;
  static double squared_structure(const Cells& frame,
                                  const std::array<double, cells>& residuals) noexcept;
  void judge(const Vec2& foot) noexcept;
  void move_origin(const Vec2& foot) noexcept;
  [[nodiscard]] Evidence& evidence(std::size_t age) noexcept {
    return ring_[(newest_ + history - age) % history];
  }
  [[nodiscard]] Ring look_beside(const Cloud& cloud, const Vec3& place) noexcept;
  [[nodiscard]] bool is_occluder(const Ring& now, double height, double jump,
                                 double hardest_strike) const noexcept;
  [[nodiscard]] double gate() const noexcept;
  [[nodiscard]] double variance(std::size_t rung) const noexcept;

  Patch patch_;
  bool tracking_ = false;
  bool smooth_ = false;
  bool holding_ = false;
  double held_since_ = 0.0;
  bool covered_ = false;        // something was before a part of the disc
  bool shadowed_ = false;       // and has come there since
  std::size_t near_usual_ = 0;  // points of the surface in the beam, with nothing before them

  LocalFrame frame_;
  Quadric surface_;
  Vec2 centre_ = Vec2::Zero();  // of the fit
  double stamp_ = 0.0;
  double interval_ = 1.0 / 30.0;
  double velocity_ = 0.0;
  double spread_ = 0.0;
  std::size_t rung_ = 0;   // whose disc tells the shape, and where the surface is
  std::size_t mover_ = 0;  // whose disc tells how it moves

  std::array<Evidence, history> ring_;
  std::array<Cells, cell_frames> cells_;
  std::size_t newest_cells_ = 0;
  std::size_t newest_ = 0;
  std::size_t count_ = 0;
  std::size_t settled_ = 0;  // frames whose heights are this surface's
  bool jumped_before_ = false;
  double above_mean_ = 0.0;  // [m] the newest frame's height over the average
  double distance_ = 0.0;    // [m] from the viewpoint
  Ring beside_{};

  // The sensor's noise outlives a contact.
  std::array<Scatter, rungs> scatter_;
  Scatter cell_scatter_;
};

}  // namespace palpate
