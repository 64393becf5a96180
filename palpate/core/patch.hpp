// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>

#include <Eigen/Core>

#include "palpate/core/parameters.hpp"

namespace palpate {

using Vec3 = Eigen::Vector3d;

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
    x_[size_] = x;
    y_[size_] = y;
    z_[size_] = z;
    ++size_;
  }

  /// Says that a cloud left points out because they were too many.
  void mark_thinned() noexcept { thinned_ = true; }

  [[nodiscard]] const Ball& ball() const noexcept { return ball_; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] bool thinned() const noexcept { return thinned_; }
  [[nodiscard]] std::size_t view_count() const noexcept { return view_count_; }
  [[nodiscard]] const View& view(std::size_t i) const noexcept { return views_[i]; }
  [[nodiscard]] const float* x() const noexcept { return x_.get(); }
  [[nodiscard]] const float* y() const noexcept { return y_.get(); }
  [[nodiscard]] const float* z() const noexcept { return z_.get(); }

 private:
  std::unique_ptr<float[]> x_, y_, z_;
  std::size_t size_ = 0;
  std::size_t view_count_ = 0;
  std::array<View, max_views> views_{};
  Ball ball_{Vec3::Zero(), 0.0};
  bool thinned_ = false;
};

/// What the points say about a proxy at one position.
struct ContactSums {
  Vec3 direction;           ///< [-] n' of (1): the weighted sum of unit vectors towards the proxy
  double nearest_distance;  ///< [m] to the nearest point; infinite without points
};

/// The weighting function psi(r) of (2): 1 up to r_1, Wendland's C2 function down to 0 at r_3.
double wendland_weight(double r, const ProxyParameters& proxy);

/// Eq. (1) and the state of section 4.1 in one pass over the patch. O(points), no allocation.
/// @param at  [m] proxy, world
ContactSums contact_sums(const Patch& patch, const Vec3& at, const ProxyParameters& proxy) noexcept;

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
