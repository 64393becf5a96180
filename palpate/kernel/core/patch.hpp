// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include <Eigen/Core>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch_loops.hpp"

namespace palpate {

using Vec3 = Eigen::Vector3d;

/// The part of `v` that is along a unit vector.
inline Vec3 along(const Vec3& v, const Vec3& unit) noexcept { return v.dot(unit) * unit; }

/// `v`, cut to a length.
inline Vec3 no_longer_than(const Vec3& v, double longest) noexcept {
  const double size = v.norm();
  return size > longest ? Vec3(longest / size * v) : v;
}

inline Float3 narrow(const Vec3& v) noexcept {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

/// A ball in the world frame [m].
struct Ball {
  Vec3 centre;
  double radius;
};

/// The points near the proxy, gathered once and then read by every step of a tick.
///
/// Structure of arrays; floats relative to `origin`, so that 5 mm is resolved to half a nanometre
/// wherever in the world the proxy is. Storage is allocated at construction only.
class Patch {
 public:
  /// The most points a patch holds. Clouds that have more thin them evenly and say so.
  static constexpr std::size_t capacity = 16384;
  /// The most clouds that can contribute to one patch.
  static constexpr std::size_t max_views = 16;
  /// Loops over a patch read whole blocks of points.
  static constexpr std::size_t block = patch_block;
  /// Coordinate [m] of the points that fill the last block: farther than any point of a patch,
  /// near enough for its square to be a float.
  static constexpr float far = 1e9F;

  /// A run of points that came from one cloud.
  struct View {
    std::size_t begin;              ///< index of its first point; it ends where the next begins
    std::optional<Vec3> viewpoint;  ///< [m] world: from where the points were seen, if known
  };

  Patch();

  /// Empties the patch and moves its origin to the ball's centre.
  void start(const Ball& ball) noexcept {
    ball_ = ball;
    size_ = 0;
    view_count_ = 0;
    thinned_ = false;
    share_ = 1.0;
  }

  /// Opens the run of points that the next `push`es belong to; a view beyond `max_views` is
  /// dropped (CloudSet refuses so many clouds at construction).
  void start_view(const std::optional<Vec3>& viewpoint) noexcept {
    if (view_count_ < max_views) views_[view_count_++] = {size_, viewpoint};
  }

  /// Adds a point relative to the origin [m], world axes. A full patch drops it and is thinned.
  void push(float x, float y, float z) noexcept {
    if (size_ == capacity) {
      thinned_ = true;
      return;
    }
    if (size_ % block == 0) fill_block();
    points_->x[size_] = x;
    points_->y[size_] = y;
    points_->z[size_] = z;
    ++size_;
  }

  /// The same as a `push` of each point whose `keep` is 1 and not 0. `count` is a multiple of
  /// `block`.
  void append(const float* x, const float* y, const float* z, const std::int32_t* keep,
              std::size_t count) noexcept {
    std::size_t size = size_;
    for (std::size_t begin = 0; begin < count; begin += block) {
      std::int32_t kept = 0;
      for (std::size_t i = begin; i < begin + block; ++i) kept += keep[i];
      if (kept == 0) continue;
      if (size + static_cast<std::size_t>(kept) > capacity) {
        thinned_ = true;
        break;
      }
      if (kept == static_cast<std::int32_t>(block)) {
        for (std::size_t i = 0; i < block; ++i) {
          points_->x[size + i] = x[begin + i];
          points_->y[size + i] = y[begin + i];
          points_->z[size + i] = z[begin + i];
        }
        size += block;
        continue;
      }
      // Without a branch for each point: a point that is not kept is overwritten by the next.
      for (std::size_t i = begin; i < begin + block; ++i) {
        points_->x[size] = x[i];
        points_->y[size] = y[i];
        points_->z[size] = z[i];
        size += static_cast<std::size_t>(keep[i]);
      }
    }
    size_ = size;
    fill_block();
  }

  /// Says that a cloud left points out because they were too many: only this `share` [-] is here.
  void mark_thinned(double share) noexcept {
    thinned_ = true;
    share_ = std::min(share_, share);
  }

  [[nodiscard]] const Ball& ball() const noexcept { return ball_; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] bool thinned() const noexcept { return thinned_; }
  /// Of the points that were to be gathered, the share [-] that an even thinning left.
  [[nodiscard]] double share() const noexcept { return share_; }
  [[nodiscard]] std::size_t view_count() const noexcept { return view_count_; }
  [[nodiscard]] const View& view(std::size_t i) const noexcept { return views_[i]; }
  /// The first point that is not view i's.
  [[nodiscard]] std::size_t view_end(std::size_t i) const noexcept {
    return i + 1 < view_count_ ? views_[i + 1].begin : size_;
  }
  /// Coordinates relative to the ball's centre [m, world axes]: size() of them, then `far` ones up
  /// to padded_size().
  [[nodiscard]] const float* x() const noexcept { return points_->x.data(); }
  [[nodiscard]] const float* y() const noexcept { return points_->y.data(); }
  [[nodiscard]] const float* z() const noexcept { return points_->z.data(); }
  /// size() rounded up to whole blocks.
  [[nodiscard]] std::size_t padded_size() const noexcept {
    return (size_ + block - 1) / block * block;
  }
  /// All of it, for the loops.
  [[nodiscard]] PointArrays points() const noexcept { return {x(), y(), z(), padded_size()}; }
  /// A place [m, world] as the points are: relative to the ball's centre.
  [[nodiscard]] Float3 relative(const Vec3& at) const noexcept { return narrow(at - ball_.centre); }
  /// Does it hold all that is within `radius` [m] of `at` [m, world]?
  [[nodiscard]] bool covers(const Vec3& at, double radius) const noexcept {
    const double room = ball_.radius - radius;
    return room >= 0.0 && (at - ball_.centre).squaredNorm() <= room * room;
  }

 private:
  // A block beyond the capacity, so that filling one never needs a bound.
  using Coordinates = std::array<float, capacity + block>;
  struct alignas(64) Points {
    Coordinates x, y, z;
  };

  // Makes the points after the last one far.
  void fill_block() noexcept {
    for (std::size_t i = size_; i < size_ + block; ++i) {
      points_->x[i] = far;
      points_->y[i] = far;
      points_->z[i] = far;
    }
  }

  std::unique_ptr<Points> points_;
  std::size_t size_ = 0;
  std::size_t view_count_ = 0;
  std::array<View, max_views> views_{};
  Ball ball_{Vec3::Zero(), 0.0};
  bool thinned_ = false;
  double share_ = 1.0;
};

/// Eq. (9): how far a sphere of radius r_c at `at` can travel along the unit vector `direction`
/// before it meets a point [m]; infinite if it meets none, 0 if it touches one that is ahead.
///
/// Departs from the print in that only points ahead count: "the smallest magnitude" would let a
/// point behind the proxy stop it.
double clear_travel(const Patch& patch, const Vec3& at, const Vec3& direction, double r_c) noexcept;

/// Eq. (10): how far a sphere at `at` must travel along the unit vector `direction` until no point
/// that is within r_1 now is nearer than r_c [m]; 0 if none is.
double escape_travel(const Patch& patch, const Vec3& at, const Vec3& direction,
                     const ProxyParameters& proxy) noexcept;

}  // namespace palpate
