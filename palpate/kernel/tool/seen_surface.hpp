// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/patch_loops.hpp"
#include "palpate/kernel/sight/height_track.hpp"

namespace palpate {

/// What one camera sees about a tool, averaged over its frames and continuous in time: 128 x 128
/// cells of one pixel or more, which move with the tool. docs/tools.md, equations (5) to (10).
///
/// A cell's depth is modelled as level + relief + noise, as sight's averaged points are: all cells
/// share the level, which moves and is extrapolated between frames; the relief is a mean that
/// begins again where new frames contradict it. What a frame corrects is spread over most of an
/// interval, so no surface jumps past a tool. A cell that shows nothing, or something that comes
/// nearer by more than a touched surface can, keeps what it showed for `hidden_hold` and
/// `hidden_fade`.
///
/// [servo] Nothing here allocates, locks or throws after construction.
class SeenSurface {
 public:
  /// The place of a tool.
  struct Aim {
    Vec3 place;     ///< [m] world: its origin
    double radius;  ///< [m] about it, in which cells are wanted
  };
  /// The surface at one place in the image.
  struct Fit {
    double gap;     ///< [m] from the place to the surface along its normal; negative: behind
    Vec3 normal;    ///< [-] unit, world, towards the free side
    double unseen;  ///< [s] since its cells were seen last
    bool wall;      ///< the side of a body of which the camera sees the edge alone
  };

  SeenSurface() : cells_(1) { cells_[0].weight.fill(1.0F); }

  /// A new frame. @param stamp, interval  [s] of it, and until the next
  void observe(const DepthImage& image, const Aim& aim, double stamp, double interval,
               const SightParameters& parameters) noexcept;
  void forget() noexcept { image_ = nullptr; }
  /// Moves the cells with the tool, and their depths on to time `t` [s].
  void start_tick(const Aim& aim, double t, const SightParameters& parameters) noexcept;
  [[nodiscard]] bool active() const noexcept { return image_ != nullptr; }
  /// Was the last of the newest frame taken in, in this tick? Bodies slide over cells all at once.
  [[nodiscard]] bool whole() const noexcept { return whole_; }
  [[nodiscard]] bool slid() const noexcept { return slid_; }  ///< Did any, in this tick?

  /// How points of a tool are projected to cells.
  struct View {
    std::array<float, 9> turn;  ///< camera_from_tool, row by row
    std::array<float, 3> shift;
    float fu, fv, cu, cv;  ///< cells by slope
    const float* depth;    ///< [m] of cells, row by row; NaN: unknown
  };
  [[nodiscard]] View view(const Eigen::Isometry3d& world_from_tool) const noexcept;
  /// Raises each gap to that of its point: [m] along the optical axis to the surface (4). A point
  /// of which nothing is known raises none.
  /// @param points  [m] of the tool, in whole blocks
  static void raise_gaps(const View& view, const PointArrays& points, float* gap) noexcept;

  /// The surface about the cell that a place [m, world] is before or behind.
  /// @param outward     [-] unit, world: where the tool's surface faces there
  /// @param side_depth  [m] how deep the sides of bodies are
  /// @return none where nothing is known, or the surface cannot touch this side of the tool
  [[nodiscard]] std::optional<Fit> fit(const Vec3& place, const Vec3& outward,
                                       double side_depth) const noexcept;
  /// [m] from a place in a body to where it is beside it (12); infinite: that is too far away.
  /// @param way  [-] in the camera's axes, of unit length along its image
  [[nodiscard]] double way_out(const Vec3& place, const Vec3& way) const noexcept;
  /// [m/s] of a body's side along a way, by what it slid over in the last frames (13); NaN: they
  /// show it for the first time.
  /// @param from  [m] where the body ends
  [[nodiscard]] double speed_along(const Vec3& from, const Vec3& way) const noexcept;
  /// [m] from a place beside a body back to it.
  [[nodiscard]] double way_back(const Vec3& place, const Vec3& way) const noexcept;
  /// [m] from cell to cell at a place before the camera.
  [[nodiscard]] double cell_at(const Vec3& place) const noexcept {
    return cell_at(in_camera(place).z());
  }
  [[nodiscard]] double stamp() const noexcept { return stamp_; }        ///< [s] of the newest frame
  [[nodiscard]] double interval() const noexcept { return interval_; }  ///< [s]
  /// A direction from the camera's axes to the world's, and back.
  [[nodiscard]] Vec3 to_world(const Vec3& way) const noexcept { return pose_.linear() * way; }
  [[nodiscard]] Vec3 to_camera(const Vec3& way) const noexcept {
    return pose_.linear().transpose() * way;
  }
  /// [m] standard deviation of a cell's average.
  [[nodiscard]] double noise() const noexcept;
  /// [m] What comes nearer by more between two frames hides what was there.
  [[nodiscard]] float hiding(const SightParameters& parameters) const noexcept;
  /// [m/s] world: how the surface moves.
  [[nodiscard]] Vec3 velocity(double t) const noexcept;
  /// [-] world, towards the camera from a place.
  [[nodiscard]] Vec3 line(const Vec3& place) const noexcept {
    return (image_->world_from_camera().translation() - place).normalized();
  }

  static constexpr int side = 128;  // cells along the window, a power of two
  /// [m] What is deeper behind a surface is not in it, but behind it, or came through its side.
  static constexpr double deepest = 10e-3;

 private:
  static constexpr std::size_t count = std::size_t{side} * side;
  struct Cells {
    std::array<float, count> shown;   // [m] depth now, row by row of the window
    std::array<float, count> relief;  // [m] above the level; NaN: unknown
    std::array<float, count> drift;   // [m] mean of the newest deviations from it
    std::array<float, count> frames;  // [-] in the relief
    std::array<float, count> smooth;  // [m] the relief as it is shown
    std::array<float, count> slides;  // [m] the relief of a body that slides over it; NaN: none
    std::array<double, count> seen;   // [s] stamp of the newest frame that showed it
    std::array<double, count> slid;   // [s] stamp of the frame that slid a body over it; NaN: none
    std::array<float, count> ray_x;   // [-] of the ray through its middle
    std::array<float, count> ray_y;
    std::array<float, count> weight;  // [-] (mean noise / its reading's)^2, as the image says
  };

  /// Where a plane is fitted.
  struct Middle {
    Vec3 p;       // [m] the place, in the camera's axes
    double x, y;  // [cells] in the window
    double from;  // [m] depth of the surface there, about
    double jump;  // [m] cells that differ by more are of another surface
  };
  struct Plane {
    double height = 0.0;                              // [m] depth at the place
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();  // [-]
    double scatter = 0.0;                             // [m] of the cells about it
    double newest = 0.0;                              // [s] stamp of the newest of them
    std::size_t cells = 0;
    double part = 1.0;  // [-] of the cells looked at, that were near the narrower plane
  };
  [[nodiscard]] std::optional<Fit> side_near(const Middle& middle,
                                             const Vec3& outward) const noexcept;
  /// The plane of fewer cells, which those of a wider one must not contradict.
  struct Narrower {
    const Plane& plane;
    double most;   // [m] that a cell may be off it,
    double reach;  // [cells]; and twice that ten times as far away, since its slope is not exact
    [[nodiscard]] bool explains(double x, double y, double z, double away) const noexcept {
      const double off = z - plane.height - plane.slope.x() * x - plane.slope.y() * y;
      return std::abs(off) <= most * (1.0 + 0.1 * away / reach);
    }
  };
  template <bool is_weighted>
  [[nodiscard]] Plane plane_through(const Middle& middle, int cells, int step,
                                    const Narrower* narrower) const noexcept;
  [[nodiscard]] Plane plane_about(const Middle& middle, int cells, int step,
                                  const Narrower* narrower = nullptr) const noexcept;

  static std::size_t index(int u, int v) noexcept {
    return static_cast<std::size_t>((v & (side - 1)) * side + (u & (side - 1)));
  }
  // The same of `shown`.
  [[nodiscard]] std::size_t shown_index(int u, int v) const noexcept {
    return static_cast<std::size_t>((v - v_) * side + (u - u_));
  }
  void aim_at(const Aim& aim) noexcept;
  void start_cell(int u, int v) noexcept;
  [[nodiscard]] float read(int u, int v) const noexcept;
  bool find_level(const Aim& aim, const SightParameters& parameters) noexcept;
  /// [m] What the image says of a cell's middle pixel; the mean if it says nothing.
  [[nodiscard]] double noise_of(int u, int v) const noexcept;
  /// Weighs a cell by that. @return [m] the spread of its readings
  float weigh(int u, int v) noexcept;
  /// [m] at 1 m, growing with the square of the distance: as the image says of `place`, or usual.
  [[nodiscard]] double noise_at_1m(const Vec3& place,
                                   const SightParameters& parameters) const noexcept;
  void update(std::size_t i, float z, float spread, const SightParameters& parameters) noexcept;
  [[nodiscard]] bool flies(int u, int v, float z, const SightParameters& parameters) const noexcept;
  [[nodiscard]] bool is_of_body(int u, int v, float z) const noexcept;
  template <typename Ends>
  [[nodiscard]] double walk(const Vec3& place, const Vec3& way, Ends ends) const noexcept;
  void read_rows(int rows, const SightParameters& parameters) noexcept;
  void slide() noexcept;
  [[nodiscard]] Vec3 in_camera(const Vec3& place) const noexcept;
  /// [cells] where a place, in the camera's axes and before it, is in the image.
  [[nodiscard]] Eigen::Vector2d cell_of(const Vec3& p) const noexcept;
  /// Is a cell in the window?
  [[nodiscard]] bool has(int u, int v) const noexcept {
    return u >= u_ && v >= v_ && u < u_ + side && v < v_ + side;
  }
  /// [m] from cell to cell, z [m] before the camera.
  [[nodiscard]] double cell_at(double z) const noexcept {
    return z * stride_ / image_->intrinsics().fx;
  }
  [[nodiscard]] double level(double t) const noexcept;
  [[nodiscard]] double offset(double t) const noexcept;
  [[nodiscard]] double unseen_since(double stamp) const noexcept {
    return stamp < stamp_ - 1.5 * interval_ ? t_ - stamp : 0.0;  // one reading may be missing
  }

  std::vector<Cells> cells_;  // one, on the heap
  const DepthImage* image_ = nullptr;
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
  int stride_ = 1;                                   // [px] of a cell
  int u_ = 0, v_ = 0;                                // the first cell
  double shift_u_ = 0.0, shift_v_ = 0.0;             // [px] of a distorted lens, here
  double stamp_ = 0.0, interval_ = 0.0;              // [s]
  std::array<HeightSample, most_heights> levels_{};  // the newest first
  std::size_t frames_ = 0;
  int rows_read_ = side;     // of the newest frame
  int struck_ = 0;           // cells of these rows that something hides
  bool slides_ = false;      // does a body slide over some of them?
  bool slid_ = false;        // since the last tick
  bool whole_ = false;       // since then
  float newest_ = 0.0F;      // [m] level of the newest frame
  float spread_ = 0.0F;      // [m] of cells about level and relief
  double mean_noise_ = 1.0;  // [m] that the image says of these cells
  double wobble_ = 0.0;      // [m] standard deviation of one frame's level
  double level_ = 0.0;       // [m] as estimated
  double velocity_ = 0.0;    // [m/s] of it
  // The blend from before the newest frame: it begins with the first tick after it.
  bool blend_due_ = false;
  double carried_ = 0.0;     // [m] the level shown before
  double offset_ = 0.0;      // [m] of the level, at the blend's start
  double blend_time_ = 0.0;  // [s]
  double blend_start_ = -std::numeric_limits<double>::infinity();
  double slid_at_ = -std::numeric_limits<double>::infinity();  // [s] the last frame that slid_
  double t_ = -std::numeric_limits<double>::infinity();        // [s] of the last tick
};

}  // namespace palpate
