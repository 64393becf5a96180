// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "palpate/kernel/core/cloud.hpp"
#include "palpate/kernel/sight/fit_test.hpp"
#include "palpate/kernel/sight/height_track.hpp"
#include "palpate/kernel/sight/surface_fit.hpp"

namespace palpate {

/// A sphere on the surface that is followed.
struct SurfaceContact {
  Vec3 foot;        ///< [m] world: the surface's point nearest to the point asked about
  Vec3 normal;      ///< [-] unit, world, towards the proxy's side
  double distance;  ///< [m] from the surface to that point, negative behind it
  bool at_limit;    ///< the surface is not known beyond `foot`: fit it there
  double
      curvature;  ///< [1/m] the strongest towards the proxy: a sphere of 1/curvature just fits in
};

/// The estimate of one surface around one place, from all frames so far: shape, position, motion
/// and measurement noise. docs/sight.md, 4 and 5. SightTracker decides which of a frame's
/// points belong to it.
///
/// [servo] Nothing here allocates, locks or throws after construction.
class SurfaceEstimate {
 public:
  /// How a frame's points are taken.
  struct Look {
    double gate;           ///< [m] points farther from the surface than this are not its own
    bool jumped = false;   ///< it was found elsewhere than expected
    bool partial = false;  ///< something hides a part of it: where points end is no edge
  };

  SurfaceEstimate() noexcept {
    noisier_.fill(1.0);
    set_spacing(0.0);
  }
  void set(const SightParameters& parameters) noexcept;
  /// A frame of `camera` at `stamp` [s], `interval` [s] after that camera's one before, will be
  /// measured.
  void start_frame(std::size_t camera, double stamp, double interval) noexcept;
  /// Begins with the surface at `foot` [m, world], with heights along `up` [-]. Earlier frames are
  /// forgotten. False if there are too few points.
  bool start(const Cloud& cloud, const Vec3& foot, const Vec3& up) noexcept;
  /// Takes a new frame's points about `foot` [m, local] in. False, and nothing has changed, if
  /// there are too few.
  bool add(const Cloud& cloud, const Vec2& foot, const Look& look) noexcept {
    return measure(cloud, foot, look, true);
  }
  /// Fits the newest frame anew about another `foot` [m, local]. False as `add`.
  bool move_to(const Cloud& cloud, const Vec2& foot, const Look& look) noexcept {
    return measure(cloud, foot, look, false);
  }
  /// Moves the surface along `up` by `height` [m].
  void shift(double height) noexcept { surface_.c[0] += height; }
  /// It is held where it is.
  void stop() noexcept { velocity_ = 0.0; }
  /// It may be another one from here on: earlier frames no longer count.
  void forget_frames() noexcept { count_ = 0; }
  /// Distance of a camera [m], from which its noise is assumed until that has been measured.
  void set_distance(std::size_t camera, double distance) noexcept { distances_[camera] = distance; }
  /// Makes discs wide enough for an image whose points lie `spacing` [m] apart (0: not known), so
  /// that the narrowest holds some 28 of them. Before `start`.
  void set_spacing(double spacing) noexcept;
  /// Are the discs too narrow or too wide, by 1.4, for such an image?
  [[nodiscard]] bool misfits(double spacing) const noexcept;

  [[nodiscard]] const LocalFrame& frame() const noexcept { return frame_; }
  [[nodiscard]] const Quadric& surface() const noexcept { return surface_; }
  [[nodiscard]] const Vec2& centre() const noexcept { return centre_; }  ///< [m] local, of the fit
  /// [m] world: the surface at the centre of the fit.
  [[nodiscard]] Vec3 place() const noexcept {
    return frame_.world_from_local(Vec3(centre_.x(), centre_.y(), surface_.height(centre_)));
  }
  /// The point of the surface nearest to `point` [m, world] at time t [s], within `reach` [m] of
  /// the centre of the fit.
  [[nodiscard]] SurfaceContact contact(const Vec3& point, double t, double reach) const noexcept;
  /// [m/s] along `up`.
  [[nodiscard]] double velocity() const noexcept { return velocity_; }
  /// [-] unit, world: the normal at the centre of the fit.
  [[nodiscard]] Vec3 normal() const noexcept {
    return frame_.direction_in_world(surface_.normal(centre_));
  }
  /// [m/s] along that.
  [[nodiscard]] double normal_velocity() const noexcept {
    return velocity_ * surface_.normal(centre_).z();
  }
  /// Whose frame was measured last; `move_to` needs that camera's cloud.
  [[nodiscard]] std::size_t camera() const noexcept { return ring_[newest_].camera; }
  [[nodiscard]] double stamp() const noexcept { return stamp_; }        ///< [s]
  [[nodiscard]] double interval() const noexcept { return interval_; }  ///< [s]
  /// How far the surface has moved along `up` at time t [s] since its frame [m].
  [[nodiscard]] double displacement(double t) const noexcept;
  /// Does the fit describe the surface, up to noise?
  [[nodiscard]] bool smooth() const noexcept { return smooth_; }
  /// Frames whose heights are this surface's.
  [[nodiscard]] std::size_t settled() const noexcept { return settled_; }
  /// Was it elsewhere than expected in the newest frame?
  [[nodiscard]] bool jumped() const noexcept { return jumped_; }
  /// Spread of the measured points about the surface [m]: how far noise can reach.
  [[nodiscard]] double spread() const noexcept { return spread_; }
  /// Standard deviation of one frame's height of the surface [m], as measured; of the best camera.
  [[nodiscard]] double height_sd() const noexcept;
  /// The same of the narrowest disc, which is as wide as the beam [m]; of the worst camera.
  [[nodiscard]] double beam_sd() const noexcept;
  /// How far the newest frame's own points may lie above the averaged surface [m].
  [[nodiscard]] double clearance() const noexcept {
    return std::max(above_mean_, 0.0) + 3.0 * spread_;
  }
  /// Points within this [m] of where the surface is expected are its own; `narrowest` [m] at
  /// least.
  [[nodiscard]] double gate() const noexcept { return gate(narrowest_gate * detail()); }
  [[nodiscard]] double gate(double narrowest) const noexcept;

  /// [m] of the narrowest disc: nothing smaller is known of the surface.
  [[nodiscard]] double resolution() const noexcept { return radii_[0]; }
  /// [-] that, in multiples of what it is before a fine image.
  [[nodiscard]] double coarseness() const noexcept {
    return radii_[0] / (narrowest_discs[0] * detail());
  }
  /// [m] in multiples of which lengths are given here.
  [[nodiscard]] double detail() const noexcept { return parameters_.detail; }
  /// [s] between frames that can tell a motion.
  [[nodiscard]] double longest_gap() const noexcept { return 0.5 * parameters_.oldest_frame; }

  static constexpr std::size_t rungs = 6;
  /// Of the discs that a fit may be averaged over [detail], before a fine image.
  static constexpr std::array<double, rungs> narrowest_discs = {1.4, 2.2, 3.6, 6.0, 10.0, 17.0};
  static constexpr double narrowest_gate = 2.4;  ///< [detail]
  static constexpr std::size_t least_points = 8;

 private:
  using Vec5 = Eigen::Matrix<double, 5, 1>;
  static constexpr std::size_t history = most_heights;
  static constexpr std::size_t frames_of_a_camera = 64;
  static constexpr std::size_t newest_heights = 5;  // whose fourth difference is looked at
  using ByCamera = std::array<double, Patch::max_views>;

  /// Moments with the height eliminated (Schur's complement): what remains determines slope and
  /// curvature.
  struct Shape {
    using Sums = Eigen::Matrix<double, 20, 1>;  // they add up over frames
    Sums sums;      // lower triangle of the matrix, row by row, and right side
    Vec5 means;     // of x, y, xx, xy, yy
    double height;  // mean z [unit]
    double points;

    static Eigen::Matrix<double, 5, 5> matrix(const Sums& sums) noexcept;
    static Vec5 right_side(const Sums& sums) noexcept { return sums.tail<5>(); }
    static Shape of(const Moments& disc) noexcept;
  };
  /// What was measured in one frame.
  struct Evidence {
    double stamp = 0.0;
    std::size_t camera = 0;
    bool smooth = false;  // the fit described the surface
    Vec2 centre = Vec2::Zero();
    bool whole = true;      // no occluder hid a part of it
    std::size_t rungs = 0;  // how many were measured
    std::size_t lost = 0;   // of these the first, out of reach by now
    std::array<Moments, SurfaceEstimate::rungs> disc;
    std::array<Shape, SurfaceEstimate::rungs> shape;
    std::array<double, SurfaceEstimate::rungs> extent;  // points in reach, thinned or not
    double information = 1.0;  // [-] mean of (usual noise / reading's noise)^2
  };
  /// Variance of a height from frame to frame.
  struct Scatter {
    double variance = 0.0;  // [m^2] from fourth differences, which smooth motion hardly changes
    double samples = 0.0;
    double at_rest = 0.0;  // [m^2] about the mean while the surface rests; 0 if unknown
    double least = 0.0;    // [m^2] a lower bound, from differences to the next narrower disc
  };
  struct Residuals {
    float median;      // [m]
    double deviation;  // [m] as of a normal distribution
  };

  /// What all frames say of each disc.
  struct Discs {
    Vec5 basis;                                                    // x, y, xx, xy, yy of the place
    std::array<Vec5, rungs> shapes;                                // slope and curvature [unit]
    std::array<std::array<HeightSample, history>, rungs> heights;  // the newest first
    std::array<std::size_t, rungs> frames{};                       // of these
    std::array<double, history> worth;         // [-] of a frame, beside its camera's others
    std::array<double, history + 1> worth_of;  // [-] of so many of the newest together
  };
  struct Choice {
    std::size_t shape = 0;    // the disc that determines shape and height
    std::size_t motion = 0;   // the disc that determines motion
    std::size_t changed = 0;  // the newest frames that show another surface
  };
  struct Comparison {
    bool agree;               // two discs, up to noise
    bool moves_along;         // the wider in the newest frame, as ever
    std::size_t changed = 0;  // as Choice's
  };

  bool measure(const Cloud& cloud, const Vec2& foot, const Look& look, bool new_frame) noexcept;
  bool find_surface(const Vec2& foot, double wide, double& cut) noexcept;
  void start_evidence(bool jumped) noexcept;
  [[nodiscard]] Moments moments_of(const Disc& disc, bool is_weighted) const noexcept;
  void add_ring(std::size_t j, const Vec2& foot, double cut) noexcept;
  void add_wide_rings(const Cloud& cloud, const Vec3& place, const Vec2& foot, double wide,
                      double reading, double cut) noexcept;
  [[nodiscard]] bool is_smooth_for_any(const Vec2& foot) noexcept;
  [[nodiscard]] std::optional<Residuals> residuals(const Vec2& foot, double radius,
                                                   double gate) const noexcept;
  bool recentre(const Vec2& foot, double gate, double& cut) noexcept;
  [[nodiscard]] double usual_noise(std::size_t camera) const noexcept;
  /// Weighs the patch's points by what `cloud` says of their noise: (usual / noise)^2 each.
  /// @param usual  [m]  @return their mean; 1, and no weights, if it says nothing
  double weigh(const Cloud& cloud, double usual) noexcept;
  void estimate(const Vec2& foot, bool new_frame, bool learns) noexcept;
  void weigh_frames(Discs& discs) noexcept;
  void average_shape(std::size_t j, const Vec2& foot, const ByCamera& doubts,
                     Discs& discs) noexcept;
  void measure_heights(std::size_t j, const ByCamera& doubts, bool learns, Discs& discs) noexcept;
  void learn_noise(const std::array<HeightSample, newest_heights>& h,
                   Scatter& scatter) const noexcept;
  [[nodiscard]] Choice choose_discs(const Discs& discs, bool learns) noexcept;
  [[nodiscard]] Comparison compare(std::size_t i, std::size_t j, const Discs& discs,
                                   bool asks_since) noexcept;
  [[nodiscard]] bool is_measured(std::size_t rung) const noexcept;
  [[nodiscard]] double expected_variance(std::size_t rung) const noexcept;
  void place_surface(Discs& discs, bool new_frame) noexcept;
  [[nodiscard]] bool spans_area() const noexcept;
  /// [m] of the moments.
  [[nodiscard]] double unit() const noexcept { return 2.0 * detail(); }
  /// Variance of a full narrowest disc along each axis [unit^2].
  [[nodiscard]] double full_disc() const noexcept {
    return 0.25 * (radii_[0] / unit()) * (radii_[0] / unit());
  }
  /// Discs of a rung are evidence about the same place if their centres are within this [m].
  [[nodiscard]] double overlap(std::size_t rung) const noexcept { return 0.5 * radii_[rung]; }
  void judge(const Vec2& foot) noexcept;
  void move_origin(const Vec2& foot) noexcept;
  [[nodiscard]] Evidence& evidence(std::size_t age) noexcept {
    return ring_[(newest_ + history - age) % history];
  }
  [[nodiscard]] double variance(std::size_t rung, std::size_t camera) const noexcept;
  /// The least of all cameras' whose frames are remembered.
  [[nodiscard]] double variance(std::size_t rung) const noexcept;
  /// A height's variance in multiples of that.
  [[nodiscard]] double doubt(std::size_t rung, std::size_t camera) const noexcept {
    return cameras_ == 1 ? 1.0 : variance(rung, camera) / variance(rung);
  }
  void align_cameras(std::span<HeightSample> heights) noexcept;
  /// How many frames are remembered: as many seconds of several cameras.
  [[nodiscard]] std::size_t most_frames() const noexcept {
    return std::min(history, cameras_ * frames_of_a_camera);
  }
  /// How many discs may be used.
  [[nodiscard]] std::size_t most_rungs() const noexcept;

  SightParameters parameters_;
  Patch patch_;
  LocalPoints points_;                                // of the patch
  std::array<float, LocalPoints::capacity> weights_;  // of the same
  bool is_weighted_ = false;
  LocalFrame frame_;
  Quadric surface_;
  Vec2 centre_ = Vec2::Zero();
  double stamp_ = 0.0;
  double interval_ = 1.0 / 30.0;
  double velocity_ = 0.0;
  double spread_ = 0.0;
  Vec5 middle_ = Vec5::Zero();  // means over the narrowest disc's points, as Shape's, unweighted
  std::size_t rung_ = 0;        // the disc that determines shape and height
  std::size_t mover_ = 0;       // the disc that determines motion

  std::array<Evidence, history> ring_;
  FitTest fit_test_;
  std::size_t newest_ = 0;
  std::size_t count_ = 0;
  std::size_t settled_ = 0;
  std::size_t rested_ = 0;  // frames since it moved
  bool jumped_ = false;
  bool smooth_ = false;
  double above_mean_ = 0.0;                        // [m] the newest frame's height over the average
  std::size_t camera_ = 0;                         // of the frame that is measured
  std::size_t cameras_ = 1;                        // of the frames that are remembered
  std::array<bool, Patch::max_views> is_known_{};  // those
  std::array<double, Patch::max_views> distances_{};  // [m] from the viewpoints
  std::array<double, Patch::max_views> noisier_;      // [-] than usual its readings are, as it says
  std::array<double, rungs> radii_{};                 // [m] of the discs

  // The sensor's noise is kept when a contact ends.
  std::array<std::array<Scatter, rungs>, Patch::max_views> scatter_;  // by camera
};

}  // namespace palpate
