// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>

#include "palpate/kernel/tool/seen_surface.hpp"

namespace palpate {

/// The side of a body that slid over a tool: for each of the tool's points that are deepest in it,
/// a plane that moves on with the body. docs/tools.md, equations (12) and (13).
///
/// [servo] Nothing here allocates, locks or throws.
class SlidingSide {
 public:
  /// A point of the tool that is in the body.
  struct Point {
    std::size_t patch;  ///< of the tool's surface
    Vec3 at, place;     ///< [m] in the tool, and in the world
  };
  static constexpr std::size_t most_points = 96;  ///< further ones are left out
  static constexpr std::size_t most_held = 8;

  void forget() noexcept { *this = {}; }
  /// Finds the way on which all points are out of a body soonest. None of it is far enough: no
  /// side.
  /// @param seen     the camera that showed the body in this tick; `camera` is its number
  /// @param normals  [-] world: of what holds the tool, along which it is pushed aside; or zero
  void find(const SeenSurface& seen, std::size_t camera, std::span<const Point> points,
            const Vec3& normals) noexcept;
  /// Follows the side to where a new frame shows it, before points that it holds or behind them.
  void follow(const SeenSurface& seen, const Eigen::Isometry3d& world_from_tool) noexcept;
  /// Of the points that it holds, at time `t` [s]; none once frames show no more of it.
  [[nodiscard]] std::size_t size(double t) const noexcept {
    return t - stamp_ < longest * interval_ ? size_ : 0;
  }
  [[nodiscard]] const Point& point(std::size_t i) const noexcept { return held_[i].of; }
  /// [m] from one of them, which is now at `place`, to the side; negative: behind it.
  [[nodiscard]] double gap(std::size_t i, const Vec3& place, double t) const noexcept {
    return normal_.dot(place) - held_[i].out - moved_since(speed_, t - stamp_, interval_);
  }
  [[nodiscard]] const Vec3& normal() const noexcept { return normal_; }  ///< [-] unit, world
  [[nodiscard]] std::size_t camera() const noexcept { return camera_; }

 private:
  static constexpr double longest = 2.5;  // [intervals] that a side lives after its frame
  struct Held {
    Point of;
    double far;  // [m] that it had to go
    double out;  // [m] along the normal, where it is out of the body
  };
  void move_to(const SeenSurface& seen, bool is_known) noexcept;

  std::array<Held, most_held> held_{};
  std::size_t size_ = 0;
  std::size_t camera_ = 0;
  Vec3 way_ = Vec3::Zero();     // [-] along the image, in the camera's axes
  Vec3 normal_ = Vec3::Zero();  // the same in the world, of unit length
  double speed_ = 0.0;          // [m/s] along the normal
  double stamp_ = -std::numeric_limits<double>::infinity();  // [s] of the frame
  double interval_ = 0.0;                                    // [s]
};

}  // namespace palpate
